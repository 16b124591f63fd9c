"""Angle of the pendulum of this folder by elliptic functions in 30 digits: truth.py > truth.csv. Needs mpmath."""
from mpmath import asin, ellipfun, mp, mpf, nstr, radians, sin, sqrt

mp.dps = 30
w, k = sqrt(mpf(2) * mpf("9.81") * mpf("0.5") / mpf("0.7")), sin(radians(mpf(75) / 2))
print("t [s], angle [rad]")
for i in range(41):
    t = mpf(i) / 4
    print(nstr(t, 5), nstr(2 * asin(k * ellipfun("cd", w * t, m=k * k).real), 17), sep=", ")
