"""Time to the latch [s], rate there [rad/s] and angle at the end [deg] of the panels of this folder, by the integral of the energy over the angle itself,
its singularity at the start taken by tanh-sinh quadrature. Needs mpmath."""
from mpmath import cos, degrees, mp, mpf, nstr, quad, radians, sqrt

mp.dps = 30
k, rest, start = mpf(4), radians(-20), radians(90)


def speed(a):
    inertia = mpf("3.3") + 12 * mpf("0.9") ** 2 - 2 * (12 * mpf("0.9") * cos(a)) ** 2 / 144
    return sqrt(k * ((start - rest) ** 2 - (a - rest) ** 2) / inertia)


print(nstr(quad(lambda a: 1 / speed(a), [0, start]), 15), nstr(-speed(mpf(0)), 15), nstr(degrees(k * rest / (k + 5000)), 15))
