"""Rates of this folder by another program: truth.py > truth.csv. Needs numpy and scipy.

The field and the gravity from potentials that are summed by associated Legendre functions in the latitude, and differenced; Euler's
equation in body axes with an attitude matrix; DOP853 from tick to tick."""
import csv, math, sys
import numpy as np
from scipy.integrate import solve_ivp

GAIN, PERIOD, MOST, RATE, YEARS = 5e4, 1.0, 0.2, 7.292115e-5, 1.9
MU, A_GRAVITY, A_FIELD = 398600.4415e9, 6378.1363e3, 6371.2e3
J = np.diag([0.04, 0.05, 0.06])


def rows(name):
    lines = [line for line in open(name) if not line.startswith("#")]
    return [[float(x) for x in row] for row in list(csv.reader(lines))[1:]]


gravity = {(int(r[0]), int(r[1])): (r[2], r[3]) for r in rows("ggm03s.csv") if 2 <= r[0] <= 8}
field = {(int(r[0]), int(r[1])): (1e-9 * (r[2] + YEARS * r[4]), 1e-9 * (r[3] + YEARS * r[5])) for r in rows("wmm2025.csv")}


def schmidt(most, s):
    """Half normalised P[n][m] at the sine of the latitude, for an array of places."""
    c = np.sqrt(1 - s * s)
    P = {(0, 0): np.ones_like(s)}
    for n in range(1, most + 1):
        P[n, n] = P[n - 1, n - 1] * c * (1.0 if n == 1 else math.sqrt((2 * n - 1) / (2 * n)))
        for m in range(n):
            below = math.sqrt((n - 1) ** 2 - m * m) * P[n - 2, m] if m < n - 1 else 0.0
            P[n, m] = ((2 * n - 1) * s * P[n - 1, m] - below) / math.sqrt(n * n - m * m)
    return P


def potential(x, a, coefficients, most, full):
    """Sum of (a/r)^n P (C cos + S sin), over r; x: 3 x places in axes that turn with the Earth."""
    r = np.sqrt((x * x).sum(axis=0))
    P, longitude, total = schmidt(most, x[2] / r), np.arctan2(x[1], x[0]), np.zeros_like(r)
    for (n, m), (C, S) in coefficients.items():
        factor = math.sqrt(2 * n + 1) if full else 1.0
        total += factor * (a / r) ** n * P[n, m] * (C * np.cos(m * longitude) + S * np.sin(m * longitude))
    return total / r


H = 2e4
STEPS = [(k, w) for k, w in ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))]


def slopes(x, a, coefficients, most, full):
    """By differences of eighth order over 20 km, at many places at once."""
    places, weights = [], []
    for axis in range(3):
        for k, w in STEPS:
            for sign in (1, -1):
                moved = x.copy()
                moved[axis] += sign * k * H
                places.append(moved), weights.append((axis, sign * w / H))
    values = potential(np.concatenate(places, axis=1), a, coefficients, most, full).reshape(len(places), -1)
    out = np.zeros_like(x)
    for (axis, w), value in zip(weights, values):
        out[axis] += w * value
    return out


def turned(t):
    c, s = math.cos(RATE * t), math.sin(RATE * t)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def magnetic(t, r):
    R = turned(t)
    return -A_FIELD**2 * R @ slopes((R.T @ r)[:, None], A_FIELD, field, 12, False)[:, 0]


def pull(t, r):
    """Acceleration and its gradient, that of the harmonics by differences over 20 km."""
    R, d = turned(t), np.linalg.norm(r)
    x = R.T @ r
    places = [x] + [x + sign * H * e for e in np.eye(3) for sign in (1, -1)]
    g = MU * slopes(np.array(places).T, A_GRAVITY, gravity, 8, True)
    G = np.array([(g[:, 1 + 2 * k] - g[:, 2 + 2 * k]) / (2 * H) for k in range(3)]).T
    point = MU / d**3
    return -point * r + R @ g[:, 0], point * (3 * np.outer(r, r) / d**2 - np.eye(3)) + R @ G @ R.T


def f(t, y, moment):
    r, v, w, Q = y[:3], y[3:6], y[6:9], y[9:].reshape(3, 3)          # Q: from body to world axes
    a, G = pull(t, r)
    Gb = Q.T @ G @ Q
    S = 0.5 * np.trace(J) * np.eye(3) - J                             # second moments
    M = S @ Gb
    tidal = np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])
    torque = tidal + np.cross(moment, Q.T @ magnetic(t, r))
    skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return np.concatenate([v, a, np.linalg.solve(J, torque - np.cross(w, J @ w)), (Q @ skew).ravel()])


y = np.concatenate([[4e6, -3e6, 4.7e6], [5600, 1500, -3800], np.radians([4, -3, 2]), np.eye(3).ravel()])
before = None
print("t [s], x [rad/s], y [rad/s], z [rad/s]")
for tick in range(1501):
    t = tick * PERIOD
    if tick % 50 == 0:
        print(int(t), *(repr(float(w)) for w in y[6:9]), sep=", ", flush=True)
    B = y[9:].reshape(3, 3).T @ magnetic(t, y[:3])
    moment = np.zeros(3) if before is None else np.clip(-GAIN * (B - before) / PERIOD, -MOST, MOST)
    before = B
    y = solve_ivp(f, (t, t + PERIOD), y, "DOP853", rtol=1e-11, atol=1e-13, args=(moment,)).y[:, -1]
    print(tick, file=sys.stderr, end="\r")
