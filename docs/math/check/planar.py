"""Checks docs/math/planar.md eqs. (3)-(9). Needs SymPy."""

import sympy as sp

a, b, c, t = sp.symbols("alpha beta gamma d", positive=True)
rx = sp.Matrix([[1, 0, 0], [0, sp.cos(a), -sp.sin(a)], [0, sp.sin(a), sp.cos(a)]])
ry = sp.Matrix([[sp.cos(b), 0, sp.sin(b)], [0, 1, 0], [-sp.sin(b), 0, sp.cos(b)]])
rz = sp.Matrix([[sp.cos(c), -sp.sin(c), 0], [sp.sin(c), sp.cos(c), 0], [0, 0, 1]])
r = rz * ry * rx

# (3)
local = r[:2, :2] / t
w = r[2, :2].T
gram = (local.T * local).applyfunc(sp.simplify)
assert sp.simplify(t**2 * gram - (sp.eye(2) - w * w.T)) == sp.zeros(2, 2)

# (4): the eigenvalues of I - w w^T are 1 and 1 - |w|^2.
w1, w2 = sp.symbols("w1 w2", real=True)
gram = (sp.eye(2) - sp.Matrix([w1, w2]) * sp.Matrix([[w1, w2]])) / t**2
delta = (w1**2 + w2**2) / t**2
assert sp.simplify(delta**2 - ((gram[0, 0] - gram[1, 1]) ** 2 + 4 * gram[0, 1] ** 2)) == 0
largest = (gram.trace() + delta) / 2
assert sp.simplify(largest - 1 / t**2) == 0

# (5)
difference = gram[0, 0] - gram[1, 1]
assert sp.simplify(largest * w1**2 - (delta - difference) / 2) == 0
assert sp.simplify(largest * w2**2 - (delta + difference) / 2) == 0
assert sp.simplify(largest * w1 * w2 + gram[0, 1]) == 0

# (6): with either sign the first two columns are orthonormal.
for sign in (1, -1):
    columns = sp.Matrix.vstack(r[:2, :2], sign * r[2, :2])
    assert sp.simplify(columns.T * columns - sp.eye(2)) == sp.zeros(2, 2)

# (7)-(9): the four-point homography sends each point to a multiple of its ray.
points = [sp.Matrix(p) for p in ([1, 2, 1], [-3, 1, 1], [2, -5, 1], [4, 3, 1])]
rays = [sp.Matrix(sp.symbols(f"b{i}x b{i}y b{i}z")) for i in range(4)]


def basis(v):
    rows = [v[1].cross(v[2]), v[2].cross(v[0]), v[0].cross(v[1])]
    return rows, [row.dot(v[3]) for row in rows]


(rows, lam), (_, mu) = basis(points), basis(rays)
homography = sum((rays[i] * rows[i].T * (mu[i] / lam[i]) for i in range(3)), sp.zeros(3, 3))
for point, ray in zip(points, rays):
    assert (homography * point).cross(ray).applyfunc(sp.expand) == sp.zeros(3, 1)

print("planar.md: all equations hold")
