"""Checks docs/math/upright_gp2p.md: eqs. (1)-(4) symbolically. Needs SymPy."""

import sympy as sp

a = sp.Matrix(sp.symbols("a1 a2 az", real=True))
b = sp.Matrix(sp.symbols("b1 b2 bz", real=True))
w = sp.Matrix(sp.symbols("w1 w2 wz", real=True))
eta, tau, rho = sp.symbols("eta tau rho", real=True)
horizontal = sp.diag(1, 1, 0)
az, bz, wz = a[2], b[2], w[2]

# (2): every tau gives the height eta; tau = 0 is the solution nearest to (0, 0).
lam0, mu0 = -(eta - wz) * az / (az**2 + bz**2), (eta - wz) * bz / (az**2 + bz**2)
lam, mu = lam0 + tau * bz, mu0 + tau * az
segment = w + mu * b - lam * a
assert sp.simplify(segment[2] - eta) == 0
assert sp.simplify(lam0 * bz + mu0 * az) == 0

# (3): the horizontal part moves along q, which is horizontal itself and equals its form by differences.
q = az * b - bz * a
d0 = horizontal * (w + mu0 * b - lam0 * a)
assert q[2] == 0 or sp.simplify(q[2]) == 0
assert sp.simplify(horizontal * segment - (d0 + tau * q)) == sp.zeros(3, 1)
assert sp.expand(az * (b - a) - (b - a)[2] * a - q) == sp.zeros(3, 1)

# (4): for any line in the plane, both points are on it and on the circle.
d1, d2, q1, q2 = sp.symbols("d1 d2 q1 q2", real=True)
d, q = sp.Matrix([d1, d2]), sp.Matrix([q1, q2])
nearest = d - q * d.dot(q) / q.dot(q)
along = q / sp.sqrt(q.dot(q))
half_chord = sp.Symbol("half_chord", nonnegative=True)
assert sp.simplify(nearest.dot(q)) == 0
found = nearest + half_chord * along
assert sp.simplify(found.dot(found) - nearest.dot(nearest) - half_chord**2) == 0
assert sp.simplify((found - d)[0] * q2 - (found - d)[1] * q1) == 0

print("upright_gp2p.md: all equations hold")
