"""Swing that the three slews of this folder leave, in deg, for shapers made for the true frequency and for 0.8 of it: the equation s'' + w^2 s = -T/J
solved from switching to switching. Nothing but Python."""
from math import cos, degrees, hypot, pi, sin

w, J, pulse = pi / 2, 40.0, 4.6


def swing(pulses, designed_for):
    edges = {}
    for i, a in enumerate(pulses):
        delay = round(i * 2 / designed_for, 2)
        for t, step in ((delay, a), (delay + pulse, -2 * a), (delay + 2 * pulse, a)):
            edges[t] = edges.get(t, 0.0) + step
    s = v = torque = now = 0.0
    for t in sorted(edges):
        c, n, rest = cos(w * (t - now)), sin(w * (t - now)), -torque / (J * w * w)
        s, v = rest + (s - rest) * c + v / w * n, v * c - (s - rest) * w * n
        now, torque = t, torque + 2.0 * edges[t]
    return degrees(hypot(s, v / w))


for designed_for in (1.0, 0.8):
    print(designed_for, *(repr(swing(p, designed_for)) for p in ((1,), (0.5, 0.5), (0.25, 0.5, 0.25))))
