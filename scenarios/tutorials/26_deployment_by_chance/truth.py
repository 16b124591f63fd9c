"""Time [s] and rate [rad/s] at zero and energy [J] of the panel of this folder with its parameters as they are given: an oscillator from rest. Needs mpmath."""
from mpmath import mp, mpf, nstr, pi, radians, sqrt

mp.dps = 30
k, inertia, start = mpf("0.4"), mpf("3.3") + 12 * mpf("0.9") ** 2, radians(90)
w = sqrt(k / inertia)
print(nstr(pi / (2 * w), 15), nstr(w * start, 15), nstr(k * start**2 / 2, 15))
