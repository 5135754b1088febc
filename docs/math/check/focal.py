"""Checks docs/math/focal.md: eqs. (3), (5)-(8), (10)-(15), (17)-(19) with rational scenes, (4) symbolically, the ranks of section 4 modulo a prime; (21), (25)-(28), (30). Needs SymPy."""

from itertools import product

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

# (14), (15), (19): three points and a column; the unknowns are (l, kappa, y, z, x).
cross = lambda q: sp.Matrix([[0, -q[2], q[1]], [q[2], 0, -q[0]], [-q[1], q[0], 0]])
ell, kappa1, kappa2 = sp.symbols("ell kappa1 kappa2")
unknowns = sp.Matrix([ell, kappa1, kappa2, y, z, x])


def three_and_a_half(points, pixels, h):
    """Rows a1, a2, q and the fourth point's equation, linear in the unknowns; points from the centroid of the first three."""
    first, second = points[1] - points[0], points[2] - points[0]
    area = first[0] * second[1] - first[1] * second[0]
    across = lambda v: sp.Matrix([-v[1], v[0]]) / area
    dual = [across(points[(i + 2) % 3] - points[(i + 1) % 3]) for i in range(3)]
    weight = [r(1, 3) + dual[i].dot(points[3][:2]) for i in range(3)]
    lam = [ell + kappa1 * points[i][0] + kappa2 * points[i][1] for i in range(3)]
    field = lambda w: sum((dual[i] * lam[i] * w[i] for i in range(3)), sp.zeros(2, 1))
    u, v = [p[0] for p in pixels], [p[1] for p in pixels]
    a1, a2, q = [sp.Matrix([*field(w), last]) for w, last in ((u, y), (v, z), ([1] * 3, x))]
    column = sum(weight[i] * lam[i] * (u[i] - u[3]) for i in range(3)) + h * (y - u[3] * x)
    return a1, a2, q, sp.expand(column), lam


PRIME = 2**31 - 1
modular = lambda value: int(sp.numer(value)) * pow(int(sp.denom(value)), -1, PRIME) % PRIME


def solved(rows):
    """Reduced row echelon form modulo the prime, and its pivots."""
    rows, pivots = [row[:] for row in rows], []
    for column in range(len(rows[0])):
        rank = len(pivots)
        found = next((i for i in range(rank, len(rows)) if rows[i][column]), None)
        if found is None:
            continue
        rows[rank], rows[found] = rows[found], rows[rank]
        inverse = pow(rows[rank][column], -1, PRIME)
        rows[rank] = [e * inverse % PRIME for e in rows[rank]]
        for i in range(len(rows)):
            if i != rank and rows[i][column]:
                factor = rows[i][column]
                rows[i] = [(e - factor * g) % PRIME for e, g in zip(rows[i], rows[rank])]
        pivots.append(column)
    return rows[: len(pivots)], pivots


def monomials(degree, order):
    """Exponents of v0 ... v4, least power of v0 first."""
    found = [e for e in product(range(degree + 1), repeat=5) if sum(e) == degree]
    return sorted(found, key=order)


for h, cubics in ((r(2, 5), 25), (r(0), 24)):
    points = [sp.Matrix(p) for p in ([-r(4, 9), -r(1, 3), 0], [r(5, 9), -r(1, 3), 0], [-r(1, 9), r(2, 3), 0], [r(3, 4), r(2, 3), h])]
    assert sum(points[:3], sp.zeros(3, 1)) == sp.zeros(3, 1)
    pixels = [project(p) for p in points]
    a1, a2, q, column, lam = three_and_a_half(points, pixels, h)
    true = {ell: translation[2] / focal, kappa1: R[2, 0] / focal, kappa2: R[2, 1] / focal, y: R[0, 2], z: R[1, 2], x: R[2, 2] / focal}
    assert a1.subs(true) == R[0, :].T and a2.subs(true) == R[1, :].T and q.subs(true) == R[2, :].T / focal
    assert column.subs(true) == 0
    for p, (u, v), depth in zip(points, pixels, lam):
        assert sp.Matrix([u, v, focal]) * depth.subs(true) == R * p + translation  # (19) with s = 1

    # Coordinates v of the five dimensions: a rational basis, the first column generic.
    coefficients = [column.coeff(name) for name in unknowns]
    null = sp.Matrix([coefficients]).nullspace()
    basis = sp.Matrix.hstack(*null) * sp.Matrix([[3, 1, -1, 2, 1], [1, 4, 1, 0, -1], [2, -1, 3, 1, 0], [-1, 2, 1, 5, 1], [1, 1, 0, -2, 4]])
    vs = sp.symbols("v0:5")
    linear = dict(zip(unknowns, basis * sp.Matrix(vs)))
    p1, p2, p3 = [row.subs(linear, simultaneous=True) for row in (a1, a2, q)]
    quadrics = [p1.dot(p2), p1.dot(p1) - p2.dot(p2), p1.dot(p3), p2.dot(p3)]
    S = p1 * p1.T + p2 * p2.T
    commutator = (cross(p3) * S - S * cross(p3)).applyfunc(sp.expand)
    assert commutator == commutator.T and sp.expand(commutator.trace()) == 0
    added = [commutator[i, j] for i, j in ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))]
    # The entries as the code writes them.
    X, Y, Z = p3
    written = [
        2 * (Y * S[0, 2] - Z * S[0, 1]), 2 * (Z * S[0, 1] - X * S[1, 2]),
        Z * (S[0, 0] - S[1, 1]) + Y * S[1, 2] - X * S[0, 2],
        Y * (S[2, 2] - S[0, 0]) + X * S[0, 1] - Z * S[1, 2],
        X * (S[1, 1] - S[2, 2]) + Z * S[0, 2] - Y * S[0, 1],
    ]
    assert all(sp.expand(a - b) == 0 for a, b in zip(added, written))

    # Ranks modulo a prime: 25 of 35 cubics (24 in a plane), whatever follows in degree 4 leaves ten as well.
    polynomials = [sp.Poly(sp.expand(e * g), *vs) for e in quadrics for g in vs] + [sp.Poly(e, *vs) for e in added]
    table = [{e: modular(c) for e, c in poly.terms()} for poly in polynomials]
    order = lambda e: (e[0], -e[4], e)
    columns = monomials(3, lambda e: (e[0], e[4] if e[0] == 0 else 0, e))
    rows, pivots = solved([[poly.get(e, 0) for e in columns] for poly in table])
    assert len(pivots) == cubics and len(solved([[poly.get(e, 0) for e in columns] for poly in table[:20]])[1]) == 20
    if h == 0:
        continue
    quartics = monomials(4, order)
    raised = [{tuple(a + (i == k) for i, a in enumerate(e)): c for e, c in poly.items()} for poly in table for k in range(5)]
    assert len(quartics) - len(solved([[poly.get(e, 0) for e in quartics] for poly in raised])[1]) == 10

    # (18): the matrix of the solved rows has the true solution's monomials as an eigenvector.
    left = [e for i, e in enumerate(columns) if i not in pivots]
    assert all(0 < e[0] for e in left) and {(3, 0, 0, 0, 0)} | {tuple(2 * (i == 0) + (i == k) for i in range(5)) for k in range(1, 5)} <= set(left)
    v_true = (basis.T * basis).inv() * basis.T * unknowns.subs(true)
    value = lambda e: sp.prod(c**n for c, n in zip(v_true / v_true[0], e))
    for e in left:
        times = tuple(a - (i == 0) + (i == 4) for i, a in enumerate(e))
        if times in left:
            row = {times: 1}
        else:
            solved_row = rows[pivots.index(columns.index(times))]
            row = {g: -solved_row[columns.index(g)] for g in left}
        image = sum(c * modular(value(g)) for g, c in row.items()) % PRIME
        assert image == modular(v_true[4] / v_true[0]) * modular(value(e)) % PRIME

# (17) is zero on every scaled rotation (a, b, c, d: its quaternion) and not on the six others.
a, b, c, d, scale = sp.symbols("a b c d scale")
rows3 = rotation(a, b, c, d) * (a**2 + b**2 + c**2 + d**2)
S = rows3[0, :].T * rows3[0, :] + rows3[1, :].T * rows3[1, :]
assert (cross(rows3[2, :]) * S - S * cross(rows3[2, :])).applyfunc(sp.expand) == sp.zeros(3, 3)
w, q = sp.Matrix([1, sp.I, 0]), sp.Matrix([2, 2 * sp.I, 5])
assert w.dot(w) == 0 and w.dot(q) == 0
S = (a**2 + b**2) * w * w.T
others = (cross(q) * S - S * cross(q)).applyfunc(sp.expand)
assert sp.expand(others[0, 0] - (a**2 + b**2) * sp.expand(others[0, 0].subs({a: 1, b: 0}))) == 0 and others != sp.zeros(3, 3)


# (21): derivatives of the camera's parameters.
lf, aspect, kappa, rho = sp.symbols("lf a kappa rho", real=True)
focal = sp.exp(lf)
fx, fy, k1 = focal * sp.exp(-aspect / 2), focal * sp.exp(aspect / 2), kappa * (focal / rho) ** 2
assert sp.simplify(sp.diff(fx, lf) - fx) == 0 and sp.simplify(sp.diff(fx, aspect) + fx / 2) == 0
assert sp.simplify(sp.diff(fy, lf) - fy) == 0 and sp.simplify(sp.diff(fy, aspect) - fy / 2) == 0
assert sp.simplify(sp.diff(k1, lf) - 2 * k1) == 0 and sp.simplify(sp.diff(k1, kappa) - (focal / rho) ** 2) == 0

# (25): a motion about the centroid p is the left motion [omega; nu + p x omega], and the pose's block of the joint inverse is that of
# refine.md eq. (9) with the answer's own covariance of the lens.
omega, shift, p, at = (sp.Matrix(sp.symbols(f"{name}1:4")) for name in ("o", "s", "p", "q"))
moved = at + omega.cross(at - p) + shift
assert (moved - (at + omega.cross(at) + shift + p.cross(omega))).expand() == sp.zeros(3, 1)
joint = sp.Matrix(3, 3, [5, 1, 2, 1, 7, 3, 2, 3, 9])
A, B = joint[:2, :2], joint[:2, 2:]
inverse = joint.inv()
assert inverse[:2, :2] - (A.inv() + A.inv() * B * inverse[2:, 2:] * B.T * A.inv()) == sp.zeros(2, 2)

# (26)-(27): along s d + s^2 b the probes at +-2 give b, and the second moment is d d^T + 3 b b^T.
sigma, d1, b1, d2, b2 = sp.symbols("sigma d1 b1 d2 b2")
along = lambda q: sp.Matrix([q * d1 + q**2 * b1, q * d2 + q**2 * b2])
assert ((along(2) + along(-2)) / 8 - sp.Matrix([b1, b2])).expand() == sp.zeros(2, 1)
moments = {0: 1, 1: 0, 2: 1, 3: 0, 4: 3}
square = (along(sigma) * along(sigma).T).expand()
mean = square.applyfunc(lambda e: sum(sp.Poly(e, sigma).coeff_monomial(sigma**k) * m for k, m in moments.items()))
D, Bend = sp.Matrix([d1, d2]), sp.Matrix([b1, b2])
assert (mean - (D * D.T + 3 * Bend * Bend.T)).expand() == sp.zeros(2, 2)

# (30): f = tan(arccos c)/g and its relative derivatives.
c, g = sp.symbols("c g", positive=True)
tau = sp.acos(c)
by_c = sp.diff(sp.log(sp.tan(tau) / g), c)
assert sp.simplify(by_c + 1 / (sp.cos(tau) * sp.sin(tau) ** 2)) == 0
assert sp.simplify(sp.diff(sp.log(sp.tan(tau) / g), g) + 1 / g) == 0

print("focal.md: all equations hold")
