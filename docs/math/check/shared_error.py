"""Checks docs/math/shared_error.md: eqs. (2)-(6), (8), (9) at random points to 40 digits against dense matrices. Needs mpmath."""

import random

import mpmath as mp

mp.mp.dps = 40
random.seed(12)


def matrix(rows, cols):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)))


def close(a, b, tolerance="1e-25"):
    assert mp.norm(a - b) < mp.mpf(tolerance) * (1 + mp.norm(b)), mp.norm(a - b)


n, degree, rho = 20, 3, mp.mpf(1) / 5
image = [(mp.mpf(random.gauss(0, 1)), mp.mpf(random.gauss(0, 1))) for _ in range(n)]
weights = [mp.mpf(random.uniform(0.5, 2)) for _ in range(n)]

# Orthonormal functions by degree, by the Cholesky factor of the Gram matrix as the code does.
powers = [(d - j, j) for d in range(degree + 1) for j in range(d + 1)]
F = mp.matrix(n, len(powers))
for i, (s, t) in enumerate(image):
    for k, (a, b) in enumerate(powers):
        F[i, k] = weights[i] * s**a * t**b
Q = F * (mp.cholesky(F.T * F) ** -1).T
close(Q.T * Q, mp.eye(len(powers)))


def projector(d, functions):
    P = mp.zeros(2 * n)
    for k, (a, b) in enumerate(powers):
        if a + b == d:
            for i in range(n):
                for j in range(n):
                    p = functions[i, k] * functions[j, k]
                    P[2 * i, 2 * j] += p
                    P[2 * i + 1, 2 * j + 1] += p
    return P


P = [projector(d, Q) for d in range(degree + 1)]
for d, p in enumerate(P):
    close(p * p, p)
    assert abs(sum(p[i, i] for i in range(2 * n)) - 2 * (d + 1)) < 1e-25

# Axes and unit of the image do not matter: other affine coordinates, the same projectors.
G = mp.matrix(n, len(powers))
for i, (s, t) in enumerate(image):
    u, v = 3 * s - 2 * t + 5, s + 4 * t - 1
    for k, (a, b) in enumerate(powers):
        G[i, k] = weights[i] * u**a * v**b
G = G * (mp.cholesky(G.T * G) ** -1).T
for d in range(degree + 1):
    close(projector(d, G), P[d], "1e-22")

J = matrix(2 * n, 6)
A = J.T * J
r = matrix(2 * n, 1)
r = r - J * (A**-1) * J.T * r
N = 2 * n - 6
lam = [rho**d / sum((k + 1) * rho**k for k in range(degree + 1)) for d in range(degree + 1)]
C = [J.T * p * J for p in P]
g = [J.T * p * r for p in P]
e = [(r.T * p * r)[0] for p in P]


def dense(theta):
    """V, -2 ln of the restricted likelihood with the variance profiled by N ln q, and q."""
    V = mp.eye(2 * n)
    for d in range(degree + 1):
        V += theta * n * lam[d] * P[d]
    # (2): the mean variance of the displacement over points is theta.
    assert abs(sum(V[i, i] - 1 for i in range(2 * n)) / (2 * n) - theta) < 1e-25
    W = V**-1
    B = J.T * W * J
    q = (r.T * W * r)[0] - (r.T * W * J * B**-1 * J.T * W * r)[0]
    return V, mp.log(mp.det(V)) + mp.log(mp.det(B)) + N * mp.log(q), q


def small(theta):
    """(4), (5)."""
    x = [theta * n * lam[d] for d in range(degree + 1)]
    s = [v / (1 + v) for v in x]
    B, h = A.copy(), mp.zeros(6, 1)
    q = (r.T * r)[0]
    for d in range(degree + 1):
        B -= s[d] * C[d]
        h -= s[d] * g[d]
        q -= s[d] * e[d]
    q -= (h.T * B**-1 * h)[0]
    ranks = sum(2 * (d + 1) * mp.log(1 + x[d]) for d in range(degree + 1))
    return ranks + mp.log(mp.det(B)) + N * mp.log(q), q


for theta in (mp.mpf("0.02"), mp.mpf(1), mp.mpf(300)):
    V, cost, q = dense(theta)
    cost_small, q_small = small(theta)
    assert abs(cost - cost_small) < 1e-25 and abs(q - q_small) < 1e-25
    # (8): the covariance of the least-squares pose under V.
    whole = A**-1 * J.T * V * J * A**-1
    field = mp.zeros(6)
    for d in range(degree + 1):
        field += theta * n * lam[d] * C[d]
    close(A**-1 + A**-1 * field * A**-1, whole)

# (5): the variance integrated with the prior d sigma / sigma: mean q/(N - 2) and likelihood ~ q^(-N/2).
q = mp.mpf(3)
likelihood = lambda sigma: sigma ** (-N) * mp.exp(-q / (2 * sigma**2)) / sigma
whole = mp.quad(likelihood, [0, mp.mpf("0.1"), 1, mp.inf])
mean = mp.quad(lambda sigma: sigma**2 * likelihood(sigma), [0, mp.mpf("0.1"), 1, mp.inf]) / whole
assert abs(mean - q / (N - 2)) < mp.mpf("1e-12") * mean
closed = q ** (-mp.mpf(N) / 2) * 2 ** (mp.mpf(N) / 2 - 1) * mp.gamma(mp.mpf(N) / 2)
assert abs(whole - closed) < mp.mpf("1e-12") * closed

# (6): the derivative of ln L at zero.
slope = mp.diff(lambda theta: -small(theta)[0] / 2, 0)
trace = lambda m: sum(m[i, i] for i in range(m.rows))
stated = sum(n * lam[d] * (e[d] - (r.T * r)[0] / N * (2 * (d + 1) - trace(A**-1 * C[d]))) for d in range(degree + 1))
assert abs(slope - stated * N / (2 * (r.T * r)[0])) < mp.mpf("1e-12") * (1 + abs(slope)), (slope, stated)

# (9): at least both in every direction.
L = mp.cholesky(A**-1)
B = matrix(6, 6)
other = B * B.T * mp.mpf("0.05")
w, U = mp.eigsy(L**-1 * other * (L**-1).T)
larger = L * U * mp.diag([max(v, mp.mpf(1)) for v in w]) * U.T * L.T
for low in (other, A**-1):
    assert min(mp.eigsy(larger - low, eigvals_only=True)) > -mp.mpf("1e-25")

print("shared_error.md: all equations hold")
