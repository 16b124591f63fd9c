"""Numbers of this folder by another program. truth.py > truth.csv: without noise, the satellite, its filter and its controller tick by
tick, with attitude matrices in place of quaternions, places in the orbit in closed form and steps of a tenth of a second. truth.py
deviations: of the errors of the filter with noise, by the recursion of their covariance."""
import sys
from math import acos, asin, atan2, cos, degrees, radians, sin, sqrt

K1, K2, STIFFNESS, DAMPING, T = 0.06, 1e-3, 5e-3, 0.12, 1.0
J, BIAS = (1.2, 1.5, 1.0), radians(20) / 3600
RADIUS, EARTH, DISC = 6878.137e3, 6378.137e3, 4.6524e-3
START, N = radians(-75), sqrt(398600.4418e9 / RADIUS**3)
SUN = (cos(radians(15)), 0.0, sin(radians(15)))
WALK, CROSS, ROLL = 1e-6, 5e-5, 4e-4
TICKS, STEPS = 3240, 10


def times(A, B):
    return [[sum(A[i][k] * B[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(A):
    return [list(row) for row in zip(*A)]


def skew(w):
    return [[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def exp(e):
    """The rotation by a vector [Rodrigues]."""
    angle = sqrt(sum(x * x for x in e))
    a, b = (sin(angle) / angle, 2 * (sin(angle / 2) / angle) ** 2) if angle > 0 else (1.0, 0.5)
    S = skew(e)
    SS = times(S, S)
    return [[(i == j) + a * S[i][j] + b * SS[i][j] for j in range(3)] for i in range(3)]


def log(R):
    """Its vector, of angles below 180 deg."""
    v = (0.5 * (R[2][1] - R[1][2]), 0.5 * (R[0][2] - R[2][0]), 0.5 * (R[1][0] - R[0][1]))
    sine, cosine = sqrt(sum(x * x for x in v)), 0.5 * (R[0][0] + R[1][1] + R[2][2] - 1)
    k = atan2(sine, cosine) / sine if sine > 0 else 1.0
    return [k * x for x in v]


def wanted(t):
    """Columns: ahead, against the normal, to the Earth."""
    c, s = cos(START + N * t), sin(START + N * t)
    return [[-s, 0.0, -c], [c, 0.0, -s], [0.0, -1.0, 0.0]]


def in_light(t):
    away = acos(-(cos(START + N * t) * SUN[0] + sin(START + N * t) * SUN[1]))       # from the Earth to the Sun, as seen
    return away > asin(EARTH / RADIUS) - DISC


def slope(y, torque):
    """Of rate, momentum of the wheels beside J w, integral of the rate."""
    w, h = y[0:3], y[3:6]
    turns = cross(w, [J[i] * w[i] + h[i] for i in range(3)])
    return [(-turns[i] - torque[i]) / J[i] for i in range(3)] + list(torque) + list(w)


def step(R, y, torque, h):
    """Runge and Kutta's of order 4; the attitude by the first two terms of the rotation vector of Magnus, the rate linear in the second."""
    at = lambda k, s: [a + s * b for a, b in zip(y, k)]
    k1 = slope(y, torque)
    k2 = slope(at(k1, h / 2), torque)
    k3 = slope(at(k2, h / 2), torque)
    k4 = slope(at(k3, h), torque)
    new = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(y, k1, k2, k3, k4)]
    twist = cross(y[0:3], new[0:3])
    return times(R, exp([new[6 + i] - y[6 + i] + h * h / 12 * twist[i] for i in range(3)])), new


def run():
    R, y = times(wanted(0), exp((0.03, -0.02, 0.04))), [0.0, -N, 0.0] + 6 * [0.0]
    A, bias, before = None, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    blinded, seen = 0, []
    print("t [s], wx [rad/s], wy [rad/s], wz [rad/s], ex [rad], ey [rad], ez [rad], bx [rad/s], by [rad/s], bz [rad/s]")
    for k in range(TICKS + 1):
        t = k * T
        turn = [y[6 + i] - before[i] + (BIAS - bias[i]) * T for i in range(3)]
        before = y[6:9]
        sun = [sum(R[j][i] * SUN[j] for j in range(3)) for i in range(3)]
        valid = not in_light(t) or degrees(acos(-sun[2])) > 38
        blinded += not valid
        if in_light(t) and degrees(acos(-sun[0])) < 65:
            seen.append(t)
        if A is None:
            A, turn = R, [0.0, -N * T, 0.0]
        else:
            A = times(A, exp(turn))
            if valid:
                e = log(times(transposed(A), R))
                A, bias = times(A, exp([K1 * x for x in e])), [bias[i] - K2 / T * e[i] for i in range(3)]
        off = log(times(transposed(wanted(t)), A))
        torque = [STIFFNESS * off[i] + DAMPING * (turn[i] / T + (N if i == 1 else 0)) for i in range(3)]
        if k % 60 == 0:
            print(int(t), *map(repr, [*y[0:3], *log(times(transposed(R), A)), *bias]), sep=", ")
        for _ in range(STEPS):
            R, y = step(R, y, torque, T / STEPS)
    print("blinded", blinded, "s, the Sun seen from", seen[0], "to", seen[-1], file=sys.stderr)


def deviations():
    """Of d, attitude of the filter less the truth, and b, its bias less the truth, about one axis. A tick: d <- d - b T + walk. A sample
    of the star tracker: d <- (1 - K1) d + K1 n, b <- b + K2 / T (d - n)."""
    for name, sigma in (("cross", CROSS), ("roll", ROLL)):
        dd, db, bb = 0.0, 0.0, 0.0
        for k in range(20000 + 1114):
            dd, db = dd - 2 * T * db + T * T * bb + WALK**2 * T, db - T * bb
            if k == 20000:
                print(name, "with the star tracker", sqrt(good[0]), "rad, bias", sqrt(good[1]), "rad/s")
            if k < 20000:
                a, c = 1 - K1, K2 / T
                dd, db, bb = a * a * dd + (K1 * sigma) ** 2, a * (db + c * dd) - K1 * c * sigma**2, bb + 2 * c * db + c * c * (dd + sigma**2)
                good = dd, bb
        print(name, "after 1114 s alone", sqrt(dd), "rad")


deviations() if sys.argv[1:] == ["deviations"] else run()
