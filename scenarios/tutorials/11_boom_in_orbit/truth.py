"""Frequencies of the boom of this folder, in rad/s, in the plane of the orbit and across it, by the determinant of the four conditions of a beam with a bus
at its root and a mass at its tip. Needs mpmath."""
from mpmath import cos, cosh, det, findroot, matrix, mp, mpf, nstr, pi, sin, sinh, sqrt

mp.dps = 30
outer, inner, L = mpf("0.015"), mpf("0.0145"), mpf(12)
line = 2700 * pi * (outer**2 - inner**2)
scale = sqrt(mpf("70e9") * pi / 4 * (outer**4 - inner**4) / (line * L**4))
M, m = 60 / (line * L), mpf("1.5") / (line * L)


def condition(J):
    """y = a cosh + b sinh + c cos + d sin of beta x; rows: moment and shear at the tip, moment and shear at the root."""
    j = mpf(J) / (line * L**3)

    def f(beta):
        ch, sh, c, s = cosh(beta), sinh(beta), cos(beta), sin(beta)
        shear = [sh + m * beta * ch, ch + m * beta * sh, s + m * beta * c, -c + m * beta * s]
        return det(matrix([[ch, sh, -c, -s], shear, [1, j * beta**3, -1, j * beta**3], [-M * beta, 1, -M * beta, -1]]))

    return f


print(*(nstr(findroot(condition(J), (mpf("2.0"), mpf("2.6")), solver="anderson") ** 2 * scale, 15) for J in (14, 15)))
