"""Place of the tip of the top of this folder, 0.1 m from the point, by elliptic functions and a quadrature in 30 digits: truth.py > truth.csv.
Needs mpmath."""
from mpmath import cos, ellipfun, mp, mpf, nstr, pi, quad, radians, sin, sqrt

mp.dps = 30
m, l, g, C = mpf("0.5"), mpf("0.06"), mpf("9.81"), mpf("4e-4")
A, spin, u0 = mpf("2.5e-4") + m * l**2, 1500 * pi / 30, cos(radians(40))
a, b = C * spin / A, 2 * m * g * l / A
root = sqrt(a**4 - 4 * b * (a**2 * u0 - b))
u1, u3 = (a**2 - root) / (2 * b), (a**2 + root) / (2 * b)
k2, rate = (u0 - u1) / (u3 - u1), sqrt(b * (u3 - u1)) / 2


def u(t):
    return (u1 + (u0 - u1) * ellipfun("cd", rate * t, m=k2) ** 2).real


print("t [s], x [m], y [m], z [m]")
turn, before = -pi / 2, mpf(0)  # a tilt about +x puts the axis at -y
for i in range(1, 26):
    t = mpf(i) / 20
    turn += quad(lambda s: a * (u0 - u(s)) / (1 - u(s) ** 2), [before, t])
    across, before = sqrt(1 - u(t) ** 2), t
    print(nstr(t, 5), *(nstr(x / 10, 17) for x in (across * cos(turn), across * sin(turn), u(t))), sep=", ")
