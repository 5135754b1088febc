"""Checks docs/math/focal.md: eqs. (3), (5)-(8), (10)-(13) with rational scenes, (4) symbolically. Needs SymPy."""

import sympy as sp

x, y, z, t = sp.symbols("x y z t")

# (3): the column of log f is the prediction itself, those of the motion are [y x j; j].
f, X, Y, Z = sp.symbols("f X Y Z", positive=True)
w = sp.Matrix(sp.symbols("w1:4"))
nu = sp.Matrix(sp.symbols("n1:4"))
arm = sp.Matrix(sp.symbols("y1:4"))
place = sp.Matrix([X, Y, Z])
for i in range(2):
    u = lambda p: f * p[i] / p[2]
    epsilon = sp.symbols("epsilon")
    derivative = sp.diff(u(place + epsilon * (w.cross(arm) + nu)), epsilon).subs(epsilon, 0)
    j = sp.Matrix([sp.diff(u(place), s) for s in (X, Y, Z)])
    assert sp.simplify(derivative - (arm.cross(j).dot(w) + j.dot(nu))) == 0
    assert sp.simplify(f * sp.diff(u(place), f) - u(place)) == 0

# (4): shift to -1, scale by 2, divide by the binomials, sum as Pascal's triangle: the code's steps give Bernstein coefficients.
n = 6
c = sp.symbols("c0:7")
b = list(c)
for k in range(n + 1):
    for i in range(n - 1, k - 1, -1):
        b[i] = b[i] - b[i + 1]
b = [b[i] * 2**i / sp.binomial(n, i) for i in range(n + 1)]
for k in range(n + 1):
    for i in range(n, k, -1):
        b[i] = b[i] + b[i - 1]
bernstein = sum(b[j] * sp.binomial(n, j) * t**j * (1 - t) ** (n - j) for j in range(n + 1))
power = sum(c[i] * (2 * t - 1) ** i for i in range(n + 1))
assert sp.expand(bernstein - power) == 0

# A rational scene: rotation from an integer quaternion, f, points with h != 0 and h = 0.
r = sp.Rational


def rotation(qw, qx, qy, qz):
    s = qw**2 + qx**2 + qy**2 + qz**2
    m = [
        [qw**2 + qx**2 - qy**2 - qz**2, 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)],
        [2 * (qx * qy + qw * qz), qw**2 - qx**2 + qy**2 - qz**2, 2 * (qy * qz - qw * qx)],
        [2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), qw**2 - qx**2 - qy**2 + qz**2],
    ]
    return sp.Matrix(m) / s


R = rotation(3, 1, -2, 1)
translation = sp.Matrix([r(1, 3), -r(1, 4), 5])
focal = r(7, 3)
project = lambda p: (focal * (R * p + translation)[0] / (R * p + translation)[2], focal * (R * p + translation)[1] / (R * p + translation)[2])

for h in (r(2, 5), r(0)):
    # The first three in the plane z = 0 of the target, the fourth at height h.
    points = [sp.Matrix(p) for p in ([0, 0, 0], [1, 0, 0], [r(1, 3), 1, 0], [r(3, 4), r(2, 3), h])]
    pixels = [project(p) for p in points]
    depth = [(R * p + translation)[2] / focal for p in points]
    first, second, off = points[1], points[2], points[3]
    area = first[0] * second[1]
    d1 = sp.Matrix([second[1], -second[0]]) / area
    d2 = sp.Matrix([-first[1], first[0]]) / area
    dual = [-d1 - d2, d1, d2]
    k = [d1.dot(off[:2]) + d2.dot(off[:2]) - 1, -d1.dot(off[:2]), -d2.dot(off[:2]), 1]
    assert sum(k) == 0 and sum((k[i] * points[i] for i in range(4)), sp.zeros(3, 1)) == sp.Matrix([0, 0, h])

    # (5): the rows of R and the heights.
    ones = [(1, 1)] * 4
    u, v = [p[0] for p in pixels], [p[1] for p in pixels]
    gradient = lambda weight: sum((dual[i] * depth[i] * weight[i] for i in range(3)), sp.zeros(2, 1))
    assert gradient(u) == R[0, :2].T and gradient(v) == R[1, :2].T and gradient([1] * 4) == R[2, :2].T / focal
    height = lambda weight: sum(k[i] * depth[i] * weight[i] for i in range(4))
    assert [height(u), height(v), height([1] * 4)] == [h * R[0, 2], h * R[1, 2], h * R[2, 2] / focal]

    # T and (6): the true unknowns solve the four forms.
    triple = lambda a, b, c: sp.Matrix([[u[i], v[i], 1] for i in (a, b, c)]).det()
    m = [triple(1, 2, 3), -triple(0, 2, 3), triple(0, 1, 3), -triple(0, 1, 2)]
    star = [m[i] * sp.prod(k[j] for j in range(4) if j != i) for i in range(4)]
    assert all(sum(k[i] * star[i] * weight[i] for i in range(4)) == 0 for weight in (u, v, [1] * 4))
    forms = sp.Matrix([star, k, [k[i] * u[i] for i in range(4)], [k[i] * v[i] for i in range(4)]])
    T = forms.inv() * sp.diag(1, h, h, h)
    omega = sum(star[i] * depth[i] for i in range(4))
    true = sp.Matrix([omega, R[2, 2] / focal, R[0, 2], R[1, 2]])
    assert T * true == sp.Matrix(depth)
    row = lambda weight, normal: sp.Matrix.vstack(
        sum((dual[i] * T[i, :] * weight[i] for i in range(3)), sp.zeros(2, 4)), sp.eye(4)[normal, :]
    )
    A1, A2, Q = row(u, 2), row(v, 3), row([1] * 4, 1)
    assert A1 * true == R[0, :].T and A2 * true == R[1, :].T and Q * true == R[2, :].T / focal
    xi = sp.Matrix([1, x, y, z])
    equations = [sp.expand((xi.T * F * xi)[0]) for F in (A1.T * A2, A1.T * A1 - A2.T * A2, A1.T * Q, A2.T * Q)]
    solution = {x: true[1] / omega, y: true[2] / omega, z: true[3] / omega}
    assert all(e.subs(solution) == 0 for e in equations)

    # (7), (8): elimination, determinant of degree at most 6, zero at the true x; null vector (z^2, y, z, 1).
    monomials = [y**2, y * z, z**2]
    polynomials = [sp.Poly(e, y, z) for e in equations]
    table = sp.Matrix([[p.coeff_monomial(mono) for mono in monomials + [y, z, 1]] for p in polynomials])
    for pivot in range(2):
        best = next(i for i in range(pivot, 4) if table[i, pivot] != 0)
        table.row_swap(pivot, best)
        table[pivot, :] = table[pivot, :] / table[pivot, pivot]
        for i in range(4):
            if i != pivot:
                table[i, :] = (table[i, :] - table[i, pivot] * table[pivot, :]).applyfunc(sp.expand)
    s3, s4 = table[2, 2], table[3, 2]
    flat, other = (table[2, :] * s4 - table[3, :] * s3, table[2, :] * s3 + table[3, :] * s4) if (s3, s4) != (0, 0) else (table[2, :], table[3, :])
    flat, other = flat.applyfunc(sp.expand), other.applyfunc(sp.expand)
    assert flat[2] == 0
    yy, yz = (-table[0, 2:]).applyfunc(sp.expand), (-table[1, 2:]).applyfunc(sp.expand)
    p, q, rest = flat[3], flat[4], flat[5]
    times_y = [yy[0] * p + yz[0] * q, yy[1] * p + yz[1] * q + rest, yy[2] * p + yz[2] * q, yy[3] * p + yz[3] * q]
    times_z = [yz[0] * p + q, yz[1] * p, yz[2] * p + rest, yz[3] * p]
    system = sp.Matrix([other[2:], flat[2:], times_y, times_z])
    determinant = sp.Poly(sp.expand(system.det(method="berkowitz")), x)
    assert 0 < determinant.degree() <= 6
    if h == 0:
        assert determinant.degree() == 4 and determinant.coeff_monomial(1) == 0 and determinant.coeff_monomial(x) == 0
    assert determinant.eval(solution[x]) == 0
    null = sp.Matrix([z**2, y, z, 1]).subs(solution)
    assert (system.subs(x, solution[x]) * null).applyfunc(sp.simplify) == sp.zeros(4, 1)

# (10)-(13) with five points, in space and in a plane.
for flatness in (1, 0):
    points = [sp.Matrix(p) for p in ([0, 0, 0], [1, 0, flatness * r(1, 2)], [0, 1, -flatness * r(1, 3)], [1, 1, flatness], [r(1, 3), r(3, 5), flatness * r(1, 5)])]
    pixels = [project(p) for p in points]
    rows = [[v * p[0], v * p[1], v * p[2], v, -u * p[0], -u * p[1], -u * p[2], -u] for p, (u, v) in zip(points, pixels)]
    true = sp.Matrix([*R[0, :], translation[0], *R[1, :], translation[1]])
    system = sp.Matrix(rows)
    assert system * true == sp.zeros(5, 1) and system.rank() == 5
    for p, (u, v) in zip(points, pixels):
        image = R * p + translation
        h_i, square = u * image[0] + v * image[1], u**2 + v**2
        assert h_i * focal - square * translation[2] == square * (R[2, :] * p)[0]

# (12): the resultant of two quadratics in y, and their common root.
a1, b1, c1, a2, b2, c2 = sp.symbols("a1 b1 c1 a2 b2 c2")
resultant = sp.resultant(a1 * y**2 + b1 * y + c1, a2 * y**2 + b2 * y + c2, y)
assert sp.expand(resultant - ((a1 * c2 - a2 * c1) ** 2 - (a1 * b2 - a2 * b1) * (b1 * c2 - b2 * c1))) == 0

# The turn of p5pf.rs is a rotation.
turn = sp.Matrix([[4, -20, 22], [28, 10, 4], [-10, 20, 20]]) / 30
assert turn.T * turn == sp.eye(3) and turn.det() == 1

print("focal.md: all equations hold")
