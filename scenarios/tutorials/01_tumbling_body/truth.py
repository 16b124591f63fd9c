"""Rates of the body of this folder at whole seconds, by Jacobi's elliptic functions in 30 digits: truth.py > truth.csv. Needs mpmath."""
from mpmath import ellipfun, mp, mpf, nstr, sqrt

mp.dps = 30
J, w1, w3 = [mpf("1.5"), mpf("2.5"), mpf("3.2")], mpf("0.8"), mpf("0.7")
E2, L2 = J[0] * w1**2 + J[2] * w3**2, (J[0] * w1) ** 2 + (J[2] * w3) ** 2
rate = sqrt((J[2] - J[1]) * (L2 - J[0] * E2) / (J[0] * J[1] * J[2]))
m = (J[1] - J[0]) * (J[2] * E2 - L2) / ((J[2] - J[1]) * (L2 - J[0] * E2))
w2 = sqrt((J[2] * E2 - L2) / (J[1] * (J[2] - J[1])))
print("t [s], x [rad/s], y [rad/s], z [rad/s]")
for t in range(26):
    w = (w1 * ellipfun("cn", rate * t, m=m), w2 * ellipfun("sn", rate * t, m=m), w3 * ellipfun("dn", rate * t, m=m))
    print(t, *(nstr(x.real, 17) for x in w), sep=", ")
