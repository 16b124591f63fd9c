"""Joint angles and torques of the arm of this folder on the reference line, by the textbook; the derivatives of the angles by differences of 40 digits
in place of formulas: truth.py > truth.csv. Needs mpmath."""
from mpmath import acos, atan2, cos, diff, mp, mpf, nstr, sin

mp.dps = 40
m1, m2, l1, l2, c1, c2, I1, I2, g = (mpf(x) for x in "6 4 1 0.8 0.5 0.4 0.5 0.2133333333333333 9.81".split())


def joints(t):
    s = min(t / 3, mpf(1))
    way = s**3 * (10 - 15 * s + 6 * s * s)
    x, z = mpf("1.5") - mpf("0.8") * way, mpf("0.2") + mpf("0.9") * way
    b = -acos((x * x + z * z - l1**2 - l2**2) / (2 * l1 * l2))
    return atan2(z, x) - atan2(l2 * sin(b), l1 + l2 * cos(b)), b


print("t [s], upper [rad], lower [rad], upper_torque [N m], lower_torque [N m]")
for i in range(1, 30):
    t = mpf(i) / 10
    a, b = joints(t)
    (u, v), (du, dv) = ([diff(lambda x: joints(x)[k], t, n) for k in (0, 1)] for n in (1, 2))
    k, h = m2 * l1 * c2 * cos(b), m2 * l1 * c2 * sin(b)
    M22 = I2 + m2 * c2**2
    t1 = (I1 + m1 * c1**2 + m2 * l1**2 + M22 + 2 * k) * du + (M22 + k) * dv - h * (2 * u * v + v * v)
    t2 = (M22 + k) * du + M22 * dv + h * u * u
    t1 += (m1 * c1 + m2 * l1) * g * cos(a) + m2 * c2 * g * cos(a + b)
    t2 += m2 * c2 * g * cos(a + b)
    print(nstr(t, 5), *(nstr(x, 17) for x in (a, b, t1, t2)), sep=", ")
