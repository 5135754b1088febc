"""Proves the equations of advise.md: a further point, the normal law of Δχ², the innovation, places and lengths on a plane, elimination.

Run: python3 docs/math/check/advise.py
"""

import random

import mpmath as mp
import sympy as sp

random.seed(8)


def rational(rows, columns):
    return sp.Matrix(rows, columns, lambda i, j: sp.Rational(random.randint(-9, 9), random.randint(2, 7)))


def positive(n):
    a = rational(n, n)
    return a * a.T + sp.eye(n)


def check(name, difference):
    difference = sp.simplify(difference)
    zero = difference == 0 or (hasattr(difference, "is_zero_matrix") and difference.is_zero_matrix)
    assert zero, (name, difference)
    print("ok ", name)


def cross(v):
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


# (1): ν_left = ν + c × ω, so that U carries a motion about the pivot to the camera; its inverse has −[c]×.
c = sp.Matrix(sp.symbols("c1:4"))
U = sp.Matrix(sp.BlockMatrix([[sp.eye(3), sp.zeros(3)], [cross(c), sp.eye(3)]]))
back = sp.Matrix(sp.BlockMatrix([[sp.eye(3), sp.zeros(3)], [-cross(c), sp.eye(3)]]))
check("(1) U and its inverse", U * back - sp.eye(6))

# (2): information of independent points adds.
J1, J2, C1, C2 = rational(8, 6), rational(2, 6), positive(8), positive(2)
J, C = J1.col_join(J2), sp.diag(C1, C2)
check("(2) a further point adds", J.T * C.inv() * J - (J1.T * C1.inv() * J1 + J2.T * C2.inv() * J2))

# (3): with residual r ~ N(0, I) at the truth and the other pose showing r + m, |m| = D: Δχ² = |r + m|² − |r|² = D² + 2 m·r.
m1, m2, r1, r2 = sp.symbols("m1 m2 r1 r2", real=True)
delta = (r1 + m1) ** 2 + (r2 + m2) ** 2 - r1**2 - r2**2
mean = delta.subs({r1: 0, r2: 0})
check("(3) mean", mean - (m1**2 + m2**2))
slope = sp.Matrix([sp.diff(delta, r1), sp.diff(delta, r2)])
check("(3) variance", (slope.T * slope)[0] - 4 * (m1**2 + m2**2))

# (4), (5) against quadrature of the normal density.
mp.mp.dps = 30
for D in (mp.mpf("0.3"), mp.mpf("1.95"), mp.mpf("6")):
    density = lambda x: mp.npdf(x, D**2, 2 * D)
    for gate in (0, 9):
        below = mp.quad(density, [D**2 - 40 * D, D**2 - 8 * D, gate] if D**2 - 8 * D < gate else [D**2 - 40 * D, gate])
        assert abs(below - mp.ncdf((gate - D**2) / (2 * D))) < 1e-15, (D, gate)
assert abs(mp.ncdf((9 - 36) / mp.mpf(12)) - mp.mpf("0.0122")) < 1e-4
print("ok  (4), (5) tails; D = 6 leaves", mp.nstr(100 * mp.ncdf(-mp.mpf(27) / 12), 3), "%")

# (6): the greatest of vᵀΣ'v / vᵀΣv is the greatest eigenvalue of Σ⁻¹Σ': L⁻¹Σ'L⁻ᵀ has the same.
S, wider = positive(3), positive(3)
lower = S.cholesky()
x = sp.symbols("x")
whitened = lower.inv() * wider * lower.inv().T
check("(6) spectrum", sp.expand(whitened.charpoly(x).as_expr() - (S.inv() * wider).charpoly(x).as_expr()))

# (7): min over ξ of χ²ₖ + ξᵀΣ⁻¹ξ + (d − Jξ)ᵀC⁻¹(d − Jξ).
S, Cx, Jx, d = positive(6), positive(2), rational(2, 6), rational(2, 1)
xi = (S.inv() + Jx.T * Cx.inv() * Jx).inv() * Jx.T * Cx.inv() * d
least = (xi.T * S.inv() * xi + (d - Jx * xi).T * Cx.inv() * (d - Jx * xi))[0]
check("(7) innovation", least - (d.T * (Cx + Jx * S * Jx.T).inv() * d)[0])

# (8): a point put on the plane by a disturbed pose and pixel, derivative by 50-digit differences of a pinhole.
mp.mp.dps = 50
f = mp.mpf(800)
R = mp.matrix([[mp.cos("0.4"), 0, mp.sin("0.4")], [0, 1, 0], [-mp.sin("0.4"), 0, mp.cos("0.4")]])
tilt = mp.matrix([[1, 0, 0], [0, mp.cos("2.1"), -mp.sin("2.1")], [0, mp.sin("2.1"), mp.cos("2.1")]])
R = R * tilt
t = mp.matrix(["0.3", "1.0", "9.0"])
X = mp.matrix(["0.7", "-0.4", "0"])


def project(p):
    return mp.matrix([f * p[0] / p[2], f * p[1] / p[2]])


def mcross(v):
    return mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def moved(xi):
    w, v = xi[:3], xi[3:]
    K = mcross(w)
    E, term = mp.eye(3), mp.eye(3)
    V, vterm = mp.eye(3), mp.eye(3)
    for n in range(1, 30):
        term = term * K / n
        vterm = vterm * K / (n + 1)
        E, V = E + term, V + vterm
    return E * R, E * t + V * mp.matrix(v)


def place(xi, pixel):
    Rm, tm = moved(xi)
    ray, origin = Rm.T * mp.matrix([pixel[0] / f, pixel[1] / f, 1]), -(Rm.T * tm)
    return origin - ray * (origin[2] / ray[2])


x = R * X + t
P = project(x)
Pi = mp.matrix([[f / x[2], 0, -f * x[0] / x[2] ** 2], [0, f / x[2], -f * x[1] / x[2] ** 2]])
B = mp.matrix([[1, 0], [0, 1], [0, 0]])
A = Pi * R * B
M = mp.matrix(3, 6)
Kx = mcross(x)
for i in range(3):
    for j in range(3):
        M[i, j] = -Kx[i, j]
    M[i, 3 + i] = 1
by_motion, by_pixel, h = -(B * A**-1 * Pi * M), B * A**-1, mp.mpf(10) ** -20
for k in range(6):
    step = [h if i == k else mp.mpf(0) for i in range(6)]
    less = [-s for s in step]
    slope = (place(step, P) - place(less, P)) / (2 * h)
    assert max(abs(slope[i] - by_motion[i, k]) for i in range(3)) < mp.mpf(10) ** -20, k
for k in range(2):
    e = mp.matrix([h if i == k else 0 for i in range(2)])
    slope = (place([mp.mpf(0)] * 6, P + e) - place([mp.mpf(0)] * 6, P - e)) / (2 * h)
    assert max(abs(slope[i] - by_pixel[i, k]) for i in range(3)) < mp.mpf(10) ** -20, k
print("ok  (8) place on a plane, 20 digits")

# (9), (10): covariance of a linear function of independent ξ and e.
G, Bp, S2, s = rational(3, 6), rational(3, 2), positive(6), sp.symbols("s", positive=True)
u, Ga, Gb, Ba, Bb = rational(3, 1), rational(3, 6), rational(3, 6), rational(3, 2), rational(3, 2)
whole = sp.Matrix.hstack(u.T * (Gb - Ga), -u.T * Ba, u.T * Bb)
spread = sp.diag(S2, s**2 * sp.eye(4))
g = (u.T * (Gb - Ga)).T
said = (g.T * S2 * g)[0] + s**2 * ((u.T * Ba * Ba.T * u)[0] + (u.T * Bb * Bb.T * u)[0])
check("(10) variance of a length", (whole * spread * whole.T)[0] - said)
check("(9) covariance of a place", sp.Matrix.hstack(G, Bp) * sp.diag(S2, s**2 * sp.eye(2)) * sp.Matrix.hstack(G, Bp).T - (G * S2 * G.T + s**2 * Bp * Bp.T))

# (11)-(13): the bounds follow from one another.
span, sig, theta = sp.symbols("span sigma theta", positive=True)
need = 12 * sig / span
check("(12) tilt", span * sp.tan(sp.atan(12 * sig / span**2)) - need)
# Ends half of span·Z to each side of the middle, at 45°: depth and width both that over √2; 2 (v·y)|y|/Z² = span²/4.
end = span / (2 * sp.sqrt(2))
check("(13) separation at 45°", 2 * end * end - span**2 / 4)
check("(13) span", (span**2 / 4 / sig).subs(span, sp.sqrt(24 * sig)) - 6)

# (14)-(16): eliminating η from a quadratic form.
n = 3
L = [positive(n) for _ in range(3)]
Ad = [rational(n, n) + 5 * sp.eye(n) for _ in range(3)]
H = sum((a.T * l * a for a, l in zip(Ad, L)), sp.zeros(n))
xis = [rational(n, 1) for _ in range(3)]
eta = -H.inv() * sum((a.T * l * v for a, l, v in zip(Ad, L, xis)), sp.zeros(n, 1))
value = sum(((v + a * eta).T * l * (v + a * eta))[0] for a, l, v in zip(Ad, L, xis))
blocks = 0
for i in range(3):
    for j in range(3):
        block = (L[i] if i == j else sp.zeros(n)) - L[i] * Ad[i] * H.inv() * Ad[j].T * L[j]
        blocks += (xis[i].T * block * xis[j])[0]
check("(16) elimination of the board", value - blocks)
gradient = sum((a.T * l * (v + a * eta) for a, l, v in zip(Ad, L, xis)), sp.zeros(n, 1))
check("(15) least", gradient)
print("all equations hold")
