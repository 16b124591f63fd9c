"""Rate of the wheel and place of the bus of this folder by the closed form: truth.py > truth.csv. Nothing but Python."""
from math import cos, exp, sin

M, m, e, Jb, v0, F, c = 95.0, 5.0, 1e-5, 8.0, 100.0, 0.1, 5e-4
J = 0.05 + M * m / (M + m) * e * e
k, limit = c * (1 / J + 1 / Jb), F / c
print("t [s], rate [rad/s], x [m], y [m]")
for t in range(39):
    turned = (v0 + limit) * (1 - exp(-k * t)) / k - limit * t
    angle, a = (J * v0 * t + Jb * turned) / (J + Jb), m / (M + m) * e
    print(t, *(repr(x) for x in ((v0 + limit) * exp(-k * t) - limit, a * (1 - cos(angle)), a * (v0 * t - sin(angle)))), sep=", ")
