"""Hinge angles of the small double pendulum of this folder, linear, by its two modes: truth.py > truth.csv. Nothing but Python."""
from math import cos, sqrt


def angles(t):
    upper = lower = 0.0
    for s in (sqrt(2), -sqrt(2)):
        w = sqrt((2 - s) * 9.81)
        rise = [1 - cos(w * x) if x > 0 else 0.0 for x in (t, t - 1)]
        x = 0.02 / ((4 + 2 * s) * w * w) * (rise[0] - rise[1])
        upper, lower = upper + x, lower + s * x
    return upper, lower - upper


print("t [s], small_1 [rad], small_2 [rad]")
for i in range(41):
    print(i / 5, *(repr(x) for x in angles(i / 5)), sep=", ")
