"""Checks docs/math/intrinsics.md: homographies, weights, the covariance over choices, the gauge of the projection, gains of groups."""

import numpy as np
import sympy as sp

# Eqs. (1), (2): the columns of K (r1 r2 t) with square pixels and a central principal point.
f, a, b, c = sp.symbols("f a b c", real=True)
f = sp.Symbol("f", positive=True)
rz = lambda t: sp.Matrix([[sp.cos(t), -sp.sin(t), 0], [sp.sin(t), sp.cos(t), 0], [0, 0, 1]])
rx = lambda t: sp.Matrix([[1, 0, 0], [0, sp.cos(t), -sp.sin(t)], [0, sp.sin(t), sp.cos(t)]])
r = rz(a) * rx(b) * rz(c)
h = sp.diag(f, f, 1) * r
x, y, w = h[:, 0], h[:, 1], 1 / f**2
assert sp.simplify((x[0] * y[0] + x[1] * y[1]) * w + x[2] * y[2]) == 0
assert sp.simplify((x[0] ** 2 + x[1] ** 2 - y[0] ** 2 - y[1] ** 2) * w + x[2] ** 2 - y[2] ** 2) == 0
# Eq. (3): least squares of p w + q = 0; a frontal view (b = 0) has q = 0, so that w = 0.
p, q, w_ = sp.symbols("p q w")
assert sp.solve(sp.diff((p * w_ + q) ** 2, w_), w_) == [-q / p]
assert all(sp.simplify(e.subs(b, 0)) == 0 for e in (x[2] * y[2], x[2] ** 2 - y[2] ** 2))

# Section 4: the share of good corners beyond 5.5 sigma, and the median of chi-square with two degrees of freedom.
t = sp.Symbol("t", positive=True)
assert sp.simplify(sp.integrate(sp.exp(-t / 2) / 2, (t, 0, 2 * sp.log(2)))) == sp.Rational(1, 2)
assert abs(float(sp.exp(-sp.Rational(11, 2) ** 2 / 2)) * 3.7e6 - 1) < 0.02

rng = np.random.default_rng(5)

# Eq. (8): law of total covariance over the choices, about the choice taken instead of the mean: never smaller.
n, k = 4, 3
weights = rng.random(n)
weights /= weights.sum()
theta = rng.normal(size=(n, k))
covariances = [m @ m.T for m in rng.normal(size=(n, k, k))]
taken = 1
cov = sum(w * (c + np.outer(v - theta[taken], v - theta[taken])) for w, c, v in zip(weights, covariances, theta))
mean = weights @ theta
total = sum(w * (c + np.outer(v - mean, v - mean)) for w, c, v in zip(weights, covariances, theta))
assert np.linalg.eigvalsh(cov - total).min() > -1e-12
assert np.allclose(cov - total, np.outer(mean - theta[taken], mean - theta[taken]))

# Eq. (12): of a linear model, exact.
A, z = rng.normal(size=(30, 5)), rng.normal(size=30)
inverse = np.linalg.inv(A.T @ A)
full = inverse @ A.T @ z
keep, drop = [0, 1, 2], [3, 4]
pull = np.linalg.solve(inverse[np.ix_(drop, drop)], full[drop])
small = np.linalg.lstsq(A[:, keep], z, rcond=None)[0]
assert np.allclose(small, full[keep] - inverse[np.ix_(keep, drop)] @ pull)
square = lambda r: r @ r
assert np.isclose(square(z - A[:, keep] @ small) - square(z - A @ full), full[drop] @ pull)
schur = inverse[np.ix_(keep, drop)] @ np.linalg.solve(inverse[np.ix_(drop, drop)], inverse[np.ix_(drop, keep)])
assert np.allclose(np.linalg.inv(A[:, keep].T @ A[:, keep]), inverse[np.ix_(keep, keep)] - schur)

# Eqs. (12) to (14) with what is known before: rows of it beside those of the views; k_eff is the trace of the hat matrix of the views.
phi, mu, tau = 0.7, rng.normal(size=5), rng.uniform(0.5, 2, size=5)
H = np.diag(tau**-2)
S = A.T @ A
total = np.linalg.inv(S + phi * H)
full = total @ (A.T @ z + phi * H @ mu)
cost = lambda x, columns: square(z - A[:, columns] @ x) + phi * square((x - mu[columns]) / tau[columns])
mu[drop] = 0
full = total @ (A.T @ z + phi * H @ mu)
pull = np.linalg.solve(total[np.ix_(drop, drop)], full[drop])
small = np.linalg.solve((S + phi * H)[np.ix_(keep, keep)], (A.T @ z + phi * H @ mu)[keep])
assert np.allclose(small, full[keep] - total[np.ix_(keep, drop)] @ pull)
assert np.isclose(cost(small, keep) - cost(full, keep + drop), full[drop] @ pull)
assert np.isclose(np.trace(A @ total @ A.T), 5 - np.trace(phi * H @ total))

# Eqs. (9), (10): the rotation is the least-squares one, and D sends to zero every change that a rotation makes.
R = rng.normal(size=(20, 2, 3))
K = rng.normal(size=(20, 2, 5))
RR = sum(m.T @ m for m in R)
RK = sum(m.T @ l for m, l in zip(R, K))
delta = rng.normal(size=5)
omega = -np.linalg.solve(RR, RK @ delta)
brute = np.linalg.lstsq(R.reshape(40, 3), -(K @ delta).reshape(40), rcond=None)[0]
assert np.allclose(omega, brute)
M = rng.normal(size=(3, 5))
same = np.einsum("nij,jk->nik", R, M)  # Intrinsics that do nothing but rotate.
D = same[0] - R[0] @ np.linalg.solve(RR, sum(m.T @ l for m, l in zip(R, same)))
assert np.allclose(D, 0)

# Eq. (11): of a linear model the gain of a group with an answer of its own is exact.
J = rng.normal(size=(12, 4, 3))
y = rng.normal(size=(12, 4))
S = np.einsum("vij,vik->vjk", J, J)
common = np.linalg.solve(S.sum(0), np.einsum("vij,vi->j", J, y))
s = np.einsum("vij,vi->vj", J, y - J @ common)
chi2 = lambda views, at: sum(((y[v] - J[v] @ at) ** 2).sum() for v in views)
for views in ([0, 3, 4, 7], list(range(6))):
    own = np.linalg.solve(S[views].sum(0), np.einsum("vij,vi->j", J[views], y[views]))
    gain = s[views].sum(0) @ np.linalg.solve(S[views].sum(0), s[views].sum(0))
    assert np.isclose(chi2(views, common) - chi2(views, own), gain)

# Eq. (15): both forms agree, and the second is the limit of the first where a coefficient has no variance.
C, Sv = np.cov(rng.normal(size=(5, 40))), A.T @ A
assert np.allclose(np.linalg.inv(np.linalg.inv(C) + Sv), C @ np.linalg.inv(np.eye(5) + Sv @ C))
C[4] = C[:, 4] = 0
limit = np.linalg.inv(np.linalg.inv(C + np.diag([0, 0, 0, 0, 1e-9])) + Sv)
assert np.allclose(limit, C @ np.linalg.inv(np.eye(5) + Sv @ C), atol=1e-7)
print("intrinsics.md holds")
