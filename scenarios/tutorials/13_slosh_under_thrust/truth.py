"""Angle of the pendulum of this folder by elliptic functions in 30 digits, then on a circle: truth.py > truth.csv. Needs mpmath."""
from mpmath import asin, diff, ellipfun, mp, mpf, nstr, radians, sin, sqrt

mp.dps = 30
w, k = sqrt(mpf(800) / (400 * mpf("0.4"))), sin(radians(20))


def angle(t):
    return 2 * asin(k * ellipfun("cd", w * t, m=k * k).real)


rate = diff(angle, 8)
print("t [s], angle [rad]")
for i in range(61):
    t = mpf(i) / 5
    print(nstr(t, 5), nstr(angle(t) if t <= 8 else angle(8) + rate * (t - 8), 17), sep=", ")
