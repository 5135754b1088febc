"""Checks docs/math/frames.md: eqs. (4)-(8), (8a), (10)-(11) in exact rational arithmetic, (12)-(13) at 30 digits, and the frontal plane of (9). Needs SymPy, mpmath."""

import sympy as sp
from mpmath import mp, mpf

half = sp.Rational(1, 2)


def rational(rows, columns, seed):
    """A full matrix of small rationals, the same on every machine."""
    value = lambda i, j: sp.Rational(((7 * i + 11 * j + 5 * i * j + seed) * 37) % 23 - 11, 5)
    return sp.Matrix(rows, columns, value)


# Two views of 5 points (10 rows each), 6 motions each, 3 shared parameters; W = diagonal, rational.
k = 3
J = [rational(10, 6, 1), rational(10, 6, 4)]
K = [rational(10, k, 2), rational(10, k, 9)]
r = [rational(10, 1, 3), rational(10, 1, 8)]
W = [sp.diag(*[sp.Rational(1 + (i * seed) % 4, 2) for i in range(10)]) for seed in (1, 3)]

# The dense normal equations.
dense_j = sp.zeros(20, 12 + k)
for i in range(2):
    dense_j[10 * i : 10 * i + 10, 6 * i : 6 * i + 6] = J[i]
    dense_j[10 * i : 10 * i + 10, 12:] = K[i]
dense_w = sp.diag(*W)
dense_r = sp.Matrix.vstack(*r)
normal = dense_j.T * dense_w * dense_j
inverse = normal.inv()
solution = inverse * dense_j.T * dense_w * dense_r

A = [J[i].T * W[i] * J[i] for i in range(2)]
B = [J[i].T * W[i] * K[i] for i in range(2)]
C = sum((K[i].T * W[i] * K[i] for i in range(2)), sp.zeros(k, k))
a = [J[i].T * W[i] * r[i] for i in range(2)]
c = sum((K[i].T * W[i] * r[i] for i in range(2)), sp.zeros(k, 1))
A_inverse = [block.inv() for block in A]
S = C - sum((B[i].T * A_inverse[i] * B[i] for i in range(2)), sp.zeros(k, k))
g = c - sum((B[i].T * A_inverse[i] * a[i] for i in range(2)), sp.zeros(k, 1))

# (4): the eliminated solution is the dense one.
eta = S.inv() * g
assert eta == solution[12:, :]
for i in range(2):
    assert A_inverse[i] * (a[i] - B[i] * eta) == solution[6 * i : 6 * i + 6, :]

# (5), (6): the marginal covariances are blocks of the dense inverse.
assert S.inv() == inverse[12:, 12:]
for i in range(2):
    gain = A_inverse[i] * B[i]
    assert A_inverse[i] + gain * S.inv() * gain.T == inverse[6 * i : 6 * i + 6, 6 * i : 6 * i + 6]

# (7): g and S from what is left of K; E g g^T = sum K'^T W (E r r^T) W K' = S as E r r^T = W^-1.
left = [K[i] - J[i] * A_inverse[i] * B[i] for i in range(2)]
assert sum((left[i].T * W[i] * r[i] for i in range(2)), sp.zeros(k, 1)) == g
assert sum((left[i].T * W[i] * left[i] for i in range(2)), sp.zeros(k, k)) == S

# (8): T is the decrease of chi2 by freeing the parameters, from the minimum over the poses alone.
poses_only = sum(((r[i].T * W[i] * r[i])[0] - (a[i].T * A_inverse[i] * a[i])[0] for i in range(2)), sp.Integer(0))
everything = (dense_r.T * dense_w * dense_r)[0] - (dense_r.T * dense_w * dense_j * solution)[0]
T = (g.T * S.inv() * g)[0]
assert poses_only - everything == T

# (10), (11): T - T_P is the score statistic of the rest with P taken out.
P, rest = [0], [1, 2]
pick = lambda m, rows, columns: m.extract(rows, columns)
S_pp, g_p = pick(S, P, P), pick(g, P, [0])
T_p = (g_p.T * S_pp.inv() * g_p)[0]
S_rest = pick(S, rest, rest) - pick(S, rest, P) * S_pp.inv() * pick(S, P, rest)
g_rest = pick(g, rest, [0]) - pick(S, rest, P) * S_pp.inv() * g_p
assert T - T_p == (g_rest.T * S_rest.inv() * g_rest)[0] and T_p <= T

# (9): a frontal plane, u = f X/z: the column of f is a multiple of that of the distance; a tilt parts them.
f, z, X, Y, tau = sp.symbols("f z X Y tau", positive=True)
frontal = sp.Matrix([f * X / z, f * Y / z])
assert sp.simplify(frontal.diff(f) + frontal.diff(z) * z / f) == sp.zeros(2, 1)
tilted = sp.Matrix([f * X * sp.cos(tau) / (z + X * sp.sin(tau)), f * Y / (z + X * sp.sin(tau))])
assert sp.simplify(tilted.diff(f) + tilted.diff(z) * z / f) != sp.zeros(2, 1)

# (12), (13) and the table of chi_square.rs.
# (8a): with the shape drawn from its prior, g_theta has the covariance S_theta, and is that of the joint minimum with the prior.
A = rational(7, 5, 6)
S, Pi = A.T * A, sp.diag(3, sp.Rational(1, 2))
tt, ts, ss = S[:3, :3], S[:3, 3:], S[3:, 3:]
inverse = (ss + Pi).inv()
S_theta = tt - ts * inverse * ts.T
by_noise = sp.eye(3).row_join(-ts * inverse)  # g_theta from the scores of both, whose noise has covariance S
by_shape = ts - ts * inverse * ss  # and from the shape
assert by_noise * S * by_noise.T + by_shape * Pi.inv() * by_shape.T == S_theta
g = rational(5, 1, 2)
joint = (S + sp.diag(0, 0, 0, 3, half)).solve(g)
assert S_theta.solve(g[:3, :] - ts * inverse * g[3:, :]) == joint[:3, :]

mp.dps = 30


def erfc(x):
    tail = x
    for n in range(60, 0, -1):
        tail = x + mpf(n) / 2 / tail
    return mp.exp(-x * x) / mp.sqrt(mp.pi) / tail


assert all(abs(erfc(mpf(x)) / mp.erfc(x) - 1) < 1e-16 for x in ("2.5", "3", "5", "8"))


def tail(k, x):
    y, total, power = mpf(x) / 2, mpf(0), mpf(k % 2) / 2
    if k % 2 == 1:
        total = mp.erfc(mp.sqrt(y))
    while power < mpf(k) / 2:
        total += y**power * mp.exp(-y) / mp.gamma(power + 1)
        power += 1
    return total


table = [(1, 1e-3), (1, 3.841), (1, 13.0), (1, 60.0), (2, 0.5), (2, 18.421), (3, 1.0), (3, 12.4), (3, 14.0), (4, 9.488), (7, 30.0), (9, 2.0), (14, 40.0), (18, 100.0)]
for k, x in table:
    exact = mp.gammainc(mpf(k) / 2, mpf(x) / 2, regularized=True)
    assert abs(tail(k, x) / exact - 1) < 1e-25
    print(f"({k}, {x}, {mp.nstr(exact, 13)})")

print("frames.md: all equations hold")
