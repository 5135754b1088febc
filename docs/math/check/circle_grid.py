"""Checks docs/math/circle_grid.md: (1), (2) against an integral and against dots.md (13), (4). Needs SymPy."""

import sympy as sp

x, y, rho, e = sp.symbols("x y rho e", positive=True)

# (1): M^(-1/2) J is a rotation times 2/rho: its product with its transpose is (4/rho^2) 1, since M^(-1/2) is symmetric.
J = sp.Matrix(2, 2, sp.symbols("j11 j12 j21 j22"))
M = rho**2 / 4 * J * J.T
# K = M^(-1/2) J has K^T K = J^T M^(-1) J.
assert sp.simplify(J.T * M.inv() * J - 4 / rho**2 * sp.eye(2)) == sp.zeros(2, 2)

# (4): from the determinant of the same moments.
assert sp.simplify(16 * M.det() / J.det() ** 2 - rho**4) == 0

# (2): a general map to third order; terms of the fourth order in rho contribute to order rho^4 only.
coefficients = {}


def polynomial(name):
    terms = [(i, k) for i in range(4) for k in range(4 - i) if 0 < i + k]
    return sum(sp.Symbol(f"{name}{i}{k}") * x**i * y**k for i, k in terms)


F = sp.Matrix([polynomial("a"), polynomial("b")])
det = F.jacobian([x, y]).det()
r, tau = sp.symbols("r tau", positive=True)
polar = {x: r * sp.cos(tau), y: r * sp.sin(tau)}


def over_disc(f):
    """Integral over the disc, monomial by monomial."""
    total = 0
    for (i, k), c in sp.Poly(sp.expand(f), x, y).terms():
        if i % 2 or k % 2 or 4 < i + k:
            continue
        angle = sp.integrate(sp.cos(tau) ** i * sp.sin(tau) ** k, (tau, 0, 2 * sp.pi))
        total += c * angle * rho ** (i + k + 2) / (i + k + 2)
    return total


at0 = {x: 0, y: 0}
area = over_disc(det)
for i in range(2):
    exact = sp.series(over_disc(F[i] * det) / area, rho, 0, 3).removeO()
    laplacian = (F[i].diff(x, 2) + F[i].diff(y, 2)).subs(at0)
    slope = sum(F[i].diff(v) * det.diff(v) / det for v in (x, y)).subs(at0)
    assert sp.simplify(exact - rho**2 / 8 * laplacian - rho**2 / 4 * slope) == 0, i

# (2) for a homography is dots.md (13) to the order rho^2: -rho^2 (h31 a + h32 b) / h33^2.
h = sp.Matrix(3, 3, sp.symbols("h11 h12 h13 h21 h22 h23 h31 h32 h33"))
w = h * sp.Matrix([x, y, 1])
G = sp.Matrix([w[0] / w[2], w[1] / w[2]])
J = G.jacobian([x, y])
det = J.det()
a, b = (h[2, 2] * J[:, 0]).subs(at0), (h[2, 2] * J[:, 1]).subs(at0)
closed = -(rho**2) * (h[2, 0] * a + h[2, 1] * b) / h[2, 2] ** 2
for i in range(2):
    laplacian = (G[i].diff(x, 2) + G[i].diff(y, 2)).subs(at0)
    slope = sum(G[i].diff(v) * sp.log(det).diff(v) for v in (x, y)).subs(at0)
    assert sp.simplify(rho**2 / 8 * laplacian + rho**2 / 4 * slope - closed[i]) == 0, i
print("ok")
