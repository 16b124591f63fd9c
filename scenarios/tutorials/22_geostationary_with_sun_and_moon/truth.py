"""Positions of this folder by another program: truth.py > truth.csv. Needs numpy and scipy.

The Sun and the Moon by the Chebyshev coefficients of DE440; third bodies as the plain difference of two pulls; the Earth by the
potential of degree 4 in associated Legendre functions, differenced, in axes by the precession angles of IAU 2006, the five largest terms
of nutation and sidereal time; light without shadow, which the orbit does not meet in January. DOP853."""
import csv, math, sys
import numpy as np
from scipy.integrate import solve_ivp

MU, A = 398600.4415e9, 6378.1363e3
GM_SUN, GM_MOON, EMRAT = 1.3271244004127942e20, 4.9028001184575496e12, 81.30056822149722
JD0, DUT1, LEAPS = 2459953.5, -0.015, 37.0
AREA, MASS, CR, FLUX, C, AU = 30.0, 1500.0, 1.3, 1361.0, 299792458.0, 149597870700.0
ARCSEC = math.pi / 648000

series = {}
for row in csv.reader(line for line in open("de440.csv") if not line.startswith("#")):
    if row[0] != "body":
        series.setdefault((row[0], row[3]), []).append((float(row[1]), float(row[2]), np.array([float(x) for x in row[4:] if x])))


def place(body, jd):
    out = []
    for axis in "xyz":
        for start, end, c in series[body, axis]:
            if start <= jd <= end:
                out.append(np.polynomial.chebyshev.chebval(2 * (jd - start) / (end - start) - 1, c))
                break
    return 1e3 * np.array(out)


def sky(t):
    jd = JD0 + t / 86400
    moon = place("moon_geocentric", jd)
    earth = place("emb", jd) - moon / (1 + EMRAT)
    return moon, place("sun", jd) - earth


def turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    return {"x": np.array([[1, 0, 0], [0, c, s], [0, -s, c]]), "y": np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]),
            "z": np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])}[axis]


def to_earth(t):
    T = (JD0 - 2451545.0 + t / 86400) / 36525
    zeta = (2.650545 + 2306.083227 * T + 0.2988499 * T * T) * ARCSEC
    z = (-2.650545 + 2306.077181 * T + 1.0927348 * T * T) * ARCSEC
    theta = (2004.191903 * T - 0.4294934 * T * T) * ARCSEC
    node, moon, sun = (math.radians(x) for x in (125.04452 - 1934.136261 * T, 218.3165 + 481267.8813 * T, 280.4665 + 36000.7698 * T))
    anomaly = math.radians(357.52910 + 35999.05030 * T)
    dpsi = (-17.206 * math.sin(node) - 1.317 * math.sin(2 * sun) - 0.228 * math.sin(2 * moon) + 0.207 * math.sin(2 * node) + 0.148 * math.sin(anomaly)) * ARCSEC
    deps = (9.205 * math.cos(node) + 0.573 * math.cos(2 * sun) + 0.098 * math.cos(2 * moon) - 0.090 * math.cos(2 * node)) * ARCSEC
    eps = (84381.406 - 46.836769 * T) * ARCSEC
    nutation = turn("x", -(eps + deps)) @ turn("z", -dpsi) @ turn("x", eps)
    days = JD0 - 2451545.0 + (t - 32.184 - LEAPS + DUT1) / 86400
    era = 2 * math.pi * (0.7790572732640 + 1.00273781191135448 * days)
    gst = era + (0.014506 + 4612.156534 * T + 1.3915817 * T * T) * ARCSEC + dpsi * math.cos(eps)
    return turn("z", gst) @ nutation @ turn("z", -z) @ turn("y", theta) @ turn("z", -zeta)


gravity = {(int(r[0]), int(r[1])): (float(r[2]), float(r[3])) for r in list(csv.reader(l for l in open("ggm03s.csv") if l[0] != "#"))[1:]
           if 2 <= int(r[0]) <= 4}


def potential(x):
    """Of degrees 2 to 4, without the central part."""
    r = np.linalg.norm(x)
    s, l = x[2] / r, math.atan2(x[1], x[0])
    c = math.sqrt(1 - s * s)
    P = {(2, 0): (3 * s * s - 1) / 2, (2, 1): 3 * s * c, (2, 2): 3 * c * c, (3, 0): s * (5 * s * s - 3) / 2, (3, 1): 1.5 * c * (5 * s * s - 1),
         (3, 2): 15 * s * c * c, (3, 3): 15 * c ** 3, (4, 0): (35 * s ** 4 - 30 * s * s + 3) / 8, (4, 1): 2.5 * s * c * (7 * s * s - 3),
         (4, 2): 7.5 * c * c * (7 * s * s - 1), (4, 3): 105 * s * c ** 3, (4, 4): 105 * c ** 4}
    total = 0.0
    for (n, m), (Cnm, Snm) in gravity.items():
        norm = math.sqrt((1 if m == 0 else 2) * (2 * n + 1) * math.factorial(n - m) / math.factorial(n + m))
        total += (A / r) ** n * norm * P[n, m] * (Cnm * math.cos(m * l) + Snm * math.sin(m * l))
    return MU / r * total


def harmonics(x, h=2e4):
    slope = np.zeros(3)
    for j in range(3):
        for k, w in ((1, 45.0), (2, -9.0), (3, 1.0)):
            d = np.zeros(3)
            d[j] = k * h
            slope[j] += w * (potential(x + d) - potential(x - d)) / (60 * h)
    return slope


def f(t, y):
    x = y[:3]
    R = to_earth(t)
    a = -MU / np.linalg.norm(x) ** 3 * x + R.T @ harmonics(R @ x)
    moon, sun = sky(t)
    for mu, d in ((GM_MOON, moon), (GM_SUN, sun)):
        a += mu * ((d - x) / np.linalg.norm(d - x) ** 3 - d / np.linalg.norm(d) ** 3)
    s = x - sun
    a += CR * AREA / MASS * FLUX / C * AU ** 2 / np.linalg.norm(s) ** 3 * s
    return np.concatenate([y[3:], a])


times = np.arange(0, 27.01, 1.0) * 86400
out = solve_ivp(f, (0, times[-1]), [42164.2e3, 0, 0, 0, 3074.66, 0], "DOP853", t_eval=times, rtol=1e-11, atol=[1e-3] * 3 + [1e-7] * 3)
print("t [s], x [m], y [m], z [m]")
for t, y in zip(out.t, out.y.T):
    print(int(t), *(repr(float(v)) for v in y[:3]), sep=", ")
