"""Speed and way of the straight stage of this folder and rates of the spinning one by the closed forms of README.md, the phase by quadrature in 30 digits:
truth.py > truth.csv. Needs mpmath."""
from mpmath import cos, log, mp, mpf, nstr, quad, sin

mp.dps = 30
c = 250 * mpf("9.80665")
mu, k2, l2 = 2000 / c, mpf("0.1"), mpf("2.25")


def state(t):
    m = 300 - mu * t
    return m, 150 + k2 * m, 60 + k2 * m


print("t [s], speed [m/s], way [m], x [rad/s], y [rad/s], z [rad/s]")
phase = mpf(0)
for t in range(0, 301, 10):
    m, across, along = state(mpf(t))
    if t > 0:
        phase += quad(lambda s: (state(s)[2] - state(s)[1]) / state(s)[1] * 45 / state(s)[2], [t - 10, t])
    ratio, w = 500 / (200 + m), mpf("0.1") * (across / 180) ** ((l2 - k2) / k2)
    row = (c * log(ratio), c * (t - (200 + m) / mu * log(ratio)), w * cos(phase), w * sin(phase), 45 / along)
    print(t, *(nstr(x, 17) for x in row), sep=", ")
