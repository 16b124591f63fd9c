"""Rates of the satellite and of the wheel of this folder by the gyrostat's closed form: truth.py > truth.csv. Nothing but Python."""
from math import cos, sin

A, C, J, T, on = 14 + 0.03 + 80 * 5 / 85 * 0.4**2, 9.0, 0.05, 0.05, 20.0
print("t [s], x [rad/s], y [rad/s], z [rad/s], wheel [rad/s]")
for t in range(31):
    s = min(t, on)
    phase = ((C + J) * 0.01 / A - 0.01) * t + T / C * (s * s / 2 + s * (t - s))
    print(t, *(repr(x) for x in (0.02 * cos(phase), 0.02 * sin(phase), 0.01 - T / C * s, T * s * (1 / J + 1 / C))), sep=", ")
