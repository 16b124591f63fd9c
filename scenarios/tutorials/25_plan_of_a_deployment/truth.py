"""When the steps of the plan of this folder happen [s], the rate [rad/s] at the first and the angle [deg] at the last: an oscillator and one that is overdamped,
each from rest. Needs mpmath."""
from mpmath import ceil, degrees, exp, mp, mpf, nstr, pi, radians, sqrt

mp.dps = 30
inertia, k, c, start = mpf("3.3") + 12 * mpf("0.9") ** 2, mpf("0.4"), mpf(12), radians(90)
w = sqrt(k / inertia)
out = 10 + pi / (2 * w)
ticked = (ceil(10 * out) + 19) / 10     # the 20th tick of 10 Hz from there on
settled = ceil(2 * ticked) / 2          # is seen at 2 Hz
r1, r2 = ((-c + s * sqrt(c * c - 4 * k * inertia)) / (2 * inertia) for s in (1, -1))
angle = start * (r2 * exp(r1 * 40) - r1 * exp(r2 * 40)) / (r2 - r1)
print(nstr(out, 15), nstr(-w * start, 15), nstr(settled, 15), nstr(settled + 40, 15), nstr(degrees(angle), 15), nstr(settled + 45, 15))
