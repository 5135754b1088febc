"""Checks docs/math/sqpnp.md eqs. (1)-(6) and the descent's turn. Needs SymPy."""

import random

import sympy as sp

random.seed(1)
rational = lambda: sp.Rational(random.randint(-9, 9), random.randint(1, 5))
matrix = lambda rows, columns: sp.Matrix(rows, columns, lambda i, j: rational())


def vec(r):
    return sp.Matrix(9, 1, lambda k, _: r[k // 3, k % 3])


# (1)-(3): exact rational arithmetic on four random points, P any symmetric matrix.
points = [matrix(3, 1) for _ in range(4)]
projections = [(lambda m: m * m.T)(matrix(3, 3)) for _ in range(4)]
r, t = matrix(3, 3), matrix(3, 1)
S = sum(projections, sp.zeros(3))
B = sum((sp.kronecker_product(P, X.T) for P, X in zip(projections, points)), sp.zeros(3, 9))
Q = sum((sp.kronecker_product(P, X * X.T) for P, X in zip(projections, points)), sp.zeros(9))
direct = sum(((r * X + t).T * P * (r * X + t))[0] for P, X in zip(projections, points))
assert direct == (vec(r).T * Q * vec(r) + 2 * t.T * B * vec(r) + t.T * S * t)[0]
best = -S.inv() * B * vec(r)
omega = Q - B.T * S.inv() * B
assert (vec(r).T * Q * vec(r) + 2 * best.T * B * vec(r) + best.T * S * best)[0] == (vec(r).T * omega * vec(r))[0]

# (4)-(6): second-order expansion of E(exp([w]) R); R need not be orthonormal for the identities.
w = sp.symbols("w1:4")
cross = lambda v: sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
k = cross(w)
turned = vec((sp.eye(3) + k + k * k / 2) * r)
energy = (turned.T * omega * turned)[0]
at_zero = {x: 0 for x in w}
m = sp.Matrix(3, 3, lambda i, j: (omega * vec(r))[3 * i + j])
W = m * r.T
gradient = [W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]
generators = [cross([int(i == k) for i in range(3)]) for k in range(3)]
for i in range(3):
    assert sp.simplify(sp.diff(energy, w[i]).subs(at_zero) / 2 - gradient[i]) == 0
    for j in range(3):
        curvature = (vec(generators[i] * r).T * omega * vec(generators[j] * r))[0]
        hessian = curvature + (W + W.T)[i, j] / 2 - int(i == j) * W.trace()
        assert sp.simplify(sp.diff(energy, w[i], w[j]).subs(at_zero) / 2 - hessian) == 0

# Cayley's formula as coded is a rotation, and exp to second order.
half = cross([x / 2 for x in w])
cayley = sp.eye(3) + (half + half * half) * 2 / (1 + sum(x * x for x in w) / 4)
assert sp.simplify(cayley.T * cayley - sp.eye(3)) == sp.zeros(3, 3)
for i in range(3):
    for j in range(3):
        difference = cayley - (sp.eye(3) + k + k * k / 2)
        assert difference.diff(w[i], w[j]).subs(at_zero) == sp.zeros(3, 3)

print("sqpnp.md: all equations hold")
