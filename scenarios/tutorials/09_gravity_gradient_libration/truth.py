"""Angle of libration of the satellite of this folder by elliptic functions in 30 digits: truth.py > truth.csv. Needs mpmath."""
from mpmath import asin, degrees, ellipfun, mp, mpf, nstr, radians, sin, sqrt

mp.dps = 30
n = sqrt(mpf("398600.4418e9") / mpf("6878137") ** 3)
w, k = n * sqrt(3 * mpf(160) / 190), sin(radians(30))
print("t [s], angle [deg]")
for t in range(0, 3801, 100):
    print(t, nstr(degrees(asin(k * ellipfun("cd", w * t, m=k * k).real)), 17), sep=", ")
