"""Numbers of this folder by another program. truth.py > truth.csv: without noise, the satellite and its modes tick by tick, with attitude
matrices in place of quaternions and steps of a twentieth of a second; the filter knows the attitude."""
import sys
from math import atan2, cos, radians, sin, sqrt

STIFFNESS, DAMPING, T = 1e-2, 0.15, 0.5
J = (1.2, 1.5, 1.0)
SLOW, FAST, MOMENT = radians(0.5), radians(0.8), 0.02
RATE, RAMP = radians(0.4), radians(0.02)
TICKS, STEPS = 1200, 10


def times(A, B):
    return [[sum(A[i][k] * B[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(A):
    return [list(row) for row in zip(*A)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def norm(a):
    return sqrt(sum(x * x for x in a))


def exp(e):
    """The rotation by a vector [Rodrigues]."""
    angle = norm(e)
    a, b = (sin(angle) / angle, 2 * (sin(angle / 2) / angle) ** 2) if angle > 0 else (1.0, 0.5)
    S = [[0.0, -e[2], e[1]], [e[2], 0.0, -e[0]], [-e[1], e[0], 0.0]]
    SS = times(S, S)
    return [[(i == j) + a * S[i][j] + b * SS[i][j] for j in range(3)] for i in range(3)]


def log(R):
    """Its vector, of angles below 180 deg."""
    v = [0.5 * (R[2][1] - R[1][2]), 0.5 * (R[0][2] - R[2][0]), 0.5 * (R[1][0] - R[0][1])]
    sine, cosine = norm(v), 0.5 * (R[0][0] + R[1][1] + R[2][2] - 1)
    k = atan2(sine, cosine) / sine if sine > 0 else 1.0
    return [k * x for x in v]


# Its columns are the axes of the body: z at the star (0, 0.6, 0.8), x in the plane of the star and the Sun (1, 0, 0), which is at right angles to it.
TARGET = [[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, -0.6, 0.8]]


def turn(angle, t):
    """Angle, rate and acceleration of a turn within both limits, and how long it takes."""
    top = min(RATE, sqrt(angle * RAMP))
    ramp = top / RAMP
    whole = ramp + angle / top
    if t >= whole:
        return angle, 0.0, 0.0, whole
    if t < ramp:
        return RAMP * t * t / 2, RAMP * t, RAMP, whole
    if t <= whole - ramp:
        return top * (t - ramp / 2), top, 0.0, whole
    return angle - RAMP * (whole - t) ** 2 / 2, RAMP * (whole - t), -RAMP, whole


def slope(y, wheels, leak):
    """Of rate, momentum of the wheels beside J w, integral of the rate."""
    w, h = y[0:3], y[3:6]
    turns = cross(w, [J[i] * w[i] + h[i] for i in range(3)])
    return [(leak[i] - turns[i] - wheels[i]) / J[i] for i in range(3)] + list(wheels) + list(w)


def step(R, y, wheels, leak, h):
    """Runge and Kutta's of order 4; the attitude by the first two terms of the rotation vector of Magnus, the rate linear in the second."""
    at = lambda k, s: [a + s * b for a, b in zip(y, k)]
    k1 = slope(y, wheels, leak)
    k2 = slope(at(k1, h / 2), wheels, leak)
    k3 = slope(at(k2, h / 2), wheels, leak)
    k4 = slope(at(k3, h), wheels, leak)
    new = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(y, k1, k2, k3, k4)]
    twist = cross(y[0:3], new[0:3])
    return times(R, exp([new[6 + i] - y[6 + i] + h * h / 12 * twist[i] for i in range(3)])), new


def run():
    R, y = exp([x * 0.5 / sqrt(6) for x in (1, -2, 1)]), [radians(x) for x in (1.5, -2, 1)] + 6 * [0.0]
    mode, begun, before, start, path = "damp", [("damp", 0.0)], [0.0, 0.0, 0.0], R, None
    print("t [s], wx [rad/s], wy [rad/s], wz [rad/s], ex [rad], ey [rad], ez [rad]")
    for k in range(TICKS + 1):
        t = k * T
        if mode == "damp" and norm(y[0:3]) <= SLOW:
            mode, start, path = "turn", R, log(times(transposed(R), TARGET))
            begun.append((mode, t))
        if mode == "turn" and t >= begun[-1][1] + turn(norm(path), 0.0)[3]:
            mode = "hold"
            begun.append((mode, t))
        w = [(y[6 + i] - before[i]) / T for i in range(3)]
        before = y[6:9]
        e, alpha = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        if mode == "turn":
            axis = [x / norm(path) for x in path]
            angle, rate, acceleration, _ = turn(norm(path), t - begun[-1][1])
            e = log(times(transposed(times(start, exp([angle * x for x in axis]))), R))
            w, alpha = [a - rate * x for a, x in zip(w, axis)], [acceleration * x for x in axis]
        elif mode == "hold":
            e = log(times(transposed(TARGET), R))
        wheels = [STIFFNESS * e[i] + DAMPING * w[i] - J[i] * alpha[i] for i in range(3)]
        leak = [0.6 * MOMENT, 0.8 * MOMENT, 0.0] if 350 <= t < 353 else [0.0, 0.0, 0.0]
        if k % 4 == 0:
            print(int(t), *map(repr, [*y[0:3], *log(times(transposed(TARGET), R))]), sep=", ")
        for i in range(STEPS):
            slow = norm(y[0:3]) < FAST
            R, y = step(R, y, wheels, leak, T / STEPS)
            if slow and norm(y[0:3]) >= FAST and t > 0:
                mode = "damp"
                begun.append((mode, t + (i + 1) * T / STEPS))
    print(begun, file=sys.stderr)


run()
