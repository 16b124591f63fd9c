"""The double pendulum of this folder in 40 digits, without Cardan: equations of Lagrange in absolute angles, integrated by the
extrapolated midpoint rule (Gragg 1965; Bulirsch, Stoer 1966). Prints t, both hinge angles and rates at whole seconds, and how much
a step of half the length changes them. Needs mpmath (Debian: python3-mpmath)."""
from mpmath import cos, mp, mpf, nstr, pi, sin

mp.dps = 40
G = mpf("9.81")


def f(x):
    """Absolute angles a, b from the vertical and their rates; masses 1 kg, rods 1 m."""
    a, b, u, v = x
    s, c = sin(a - b), cos(a - b)
    d = 2 - c * c
    du = (-2 * G * sin(a) + G * sin(b) * c - s * (v * v + u * u * c)) / d
    dv = (-2 * G * sin(b) + 2 * G * sin(a) * c + s * (2 * u * u + v * v * c)) / d
    return [u, v, du, dv]


def midpoint(x, h, n):
    h = h / n
    before, now = x, [p + h * q for p, q in zip(x, f(x))]
    for _ in range(n - 1):
        before, now = now, [p + 2 * h * q for p, q in zip(before, f(now))]
    return [(p + q + h * r) / 2 for p, q, r in zip(before, now, f(now))]


def step(x, h, stages=14):
    table = []
    for k in range(stages):
        row = [midpoint(x, h, 2 * (k + 1))]
        for j in range(k):
            ratio = mpf((k + 1) ** 2) / (k - j) ** 2 - 1
            row.append([p + (p - q) / ratio for p, q in zip(row[j], table[k - 1][j])])
        table.append(row)
    return table[-1][-1]


def run(steps_per_second, seconds=6):
    x = [2 * pi / 3, pi / 3, mpf(0), mpf(0)]
    rows = []
    for _ in range(seconds):
        for _ in range(steps_per_second):
            x = step(x, mpf(1) / steps_per_second)
        rows.append([x[0], x[1] - x[0], x[2], x[3] - x[2]])
    return rows


fine, coarse = run(60), run(30)
for t, (row, other) in enumerate(zip(fine, coarse), 1):
    change = max(abs(p - q) for p, q in zip(row, other))
    print(t, *(nstr(value, 20) for value in row), " # changed by", nstr(change, 2))
