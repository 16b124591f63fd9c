"""Lower end of the chain of this folder in its second and fourth mode, zeros of the Laguerre polynomial by bisection in 50 digits: truth.py > truth.csv.
Needs mpmath."""
from mpmath import cos, mp, mpf, nstr, sqrt

mp.dps = 50
N, g, l = 100, mpf("9.81"), mpf("0.1")


def laguerre(x):
    before, now = mpf(1), 1 - x
    for j in range(1, N):
        before, now = now, ((2 * j + 1 - x) * now - j * before) / (j + 1)
    return now


zeros, x, step = [], mpf(0), mpf("0.001")
while len(zeros) < 4:
    if laguerre(x) * laguerre(x + step) < 0:
        low, high = x, x + step
        for _ in range(120):
            middle = (low + high) / 2
            low, high = (low, middle) if laguerre(low) * laguerre(middle) <= 0 else (middle, high)
        zeros.append(low)
    x += step
print("t [s], x [m]")
for i in range(0, 61):
    t = mpf(i) / 10
    print(nstr(t, 5), nstr(sum(mpf("1e-4") * cos(sqrt(g / l * zeros[k]) * t) for k in (1, 3)), 17), sep=", ")
