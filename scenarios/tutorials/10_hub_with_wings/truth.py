"""Frequencies of the satellite of this folder, in Hz, by the differential equation of its wings: determinants of the conditions at both ends of a
wing, in place of the eliminated form of the scenario. Needs mpmath."""
from mpmath import cos, cosh, det, findroot, matrix, mp, mpf, nstr, pi, sin, sinh, sqrt

mp.dps = 30
line, L = mpf(2700) * mpf("0.2") * mpf("0.004"), mpf(5)
scale = sqrt(mpf("70e9") * mpf("0.2") * mpf("0.004") ** 3 / 12 / (line * L**4)) / (2 * pi)
j, m = mpf(54) / (2 * line * L**3), mpf("8.1") / (2 * line * L)


def condition(turned):
    """y = a cosh + b sinh + c cos + d sin of beta x; rows: the root, the tip twice, the root."""

    def f(beta):
        ch, sh, c, s = cosh(beta), sinh(beta), cos(beta), sin(beta)
        tip = [[ch, sh, -c, -s], [sh, ch, s, -c]]
        if turned:  # y(0) = 0, y''(0) = -j beta^4 y'(0)
            return det(matrix([[1, 0, 1, 0], *tip, [1, j * beta**3, -1, j * beta**3]]))
        return det(matrix([[0, 1, 0, 1], *tip, [-m * beta, 1, -m * beta, -1]]))  # y'(0) = 0, y'''(0) = m beta^4 y(0)

    return f


found = sorted(findroot(condition(turned), start) ** 2 * scale for turned, starts in ((True, (2.64, 4.79, 7.88)), (False, (2.17, 5.04, 8.1))) for start in starts)
print(*(nstr(x, 15) for x in found))
