"""The same hub and boom by their two equations of motion, with gains by SciPy (QZ, expm): truth.py > truth.csv. Needs numpy and scipy."""
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_are

J, m, c, Jb, d, k, b = 30.0, 5.0, 1.5, 4.0, 1.0, 40.0, 0.1
target, dt = np.radians(30), 0.1


def mass(phi):
    m12 = m * (c * c + d * c * np.cos(phi)) + Jb
    return np.array([[J + m * (d * d + c * c + 2 * d * c * np.cos(phi)) + Jb, m12], [m12, m * c * c + Jb]])


def motion(u):
    def f(t, x):
        h = m * d * c * np.sin(x[1])
        force = np.array([u + h * (2 * x[2] * x[3] + x[3] ** 2), -k * x[1] - b * x[3] - h * x[2] ** 2])
        return np.concatenate([x[2:], np.linalg.solve(mass(x[1]), force)])
    return f


inverse = np.linalg.inv(mass(0.0))
A, B, C = np.zeros((4, 4)), np.zeros((4, 1)), np.array([[1.0, 0, 0, 0]])
A[:2, 2:], A[2:, 1], A[2:, 3], B[2:, 0] = np.eye(2), -k * inverse[:, 1], -b * inverse[:, 1], inverse[:, 0]
both = expm(np.block([[A, B], [np.zeros((1, 5))]]) * dt)
Ad, Bd = both[:4, :4], both[:4, 4:]
W = np.diag([0, 0, 0.01, 0.01])
nodes, weights = np.polynomial.legendre.leggauss(12)  # the covariance of the noise, as the integral that it is
Wd = sum(0.5 * dt * w * expm(A * s) @ W @ expm(A * s).T for s, w in ((0.5 * dt * (1 + x), w) for x, w in zip(nodes, weights)))
Q, R, V = np.diag([10.0, 10, 1, 1]), np.array([[1e-4]]), np.array([[1e-8]])
X = solve_discrete_are(Ad, Bd, Q, R)
K = np.linalg.solve(R + Bd.T @ X @ Bd, Bd.T @ X @ Ad)
P = solve_discrete_are(Ad.T, C.T, Wd, V)
L = P @ C.T @ np.linalg.inv(C @ P @ C.T + V)

x, z = np.zeros(4), np.array([-target, 0, 0, 0])
print("t [s], hub [rad], boom [rad], torque [N m]")
for i in range(201):
    z = z + (L @ (np.array([x[0] - target]) - C @ z))
    u = float(-(K @ z)[0])
    print(repr(i * dt), repr(float(x[0])), repr(float(x[1])), repr(u), sep=", ")
    z = Ad @ z + Bd[:, 0] * u
    x = solve_ivp(motion(u), (0, dt), x, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
