"""Checks docs/math/whisker_identify.md: eqs. (1), (3)-(7), (9), (10), (15), symbolically and at random points to 40 digits. Needs SymPy
and mpmath."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(3)
TOLERANCE = mp.mpf("1e-12")  # central differences of step 1e-13 err by 1e-26, relative to third derivatives of 1e6


def rand(low, high):
    return mp.mpf(random.uniform(low, high))


def normal(beta):
    return mp.matrix([mp.cos(beta), mp.sin(beta)])


def tangent(beta):
    return mp.matrix([-mp.sin(beta), mp.cos(beta)])


def dot(a, b):
    return (a.T * b)[0]


def slope(f, at, h=mp.mpf("1e-13")):
    return (f(at + h) - f(at - h)) / (2 * h)


def close(name, a, b, scale=1):
    error = mp.norm(mp.matrix([a - b])) if not isinstance(a, mp.matrix) else mp.norm(a - b)
    assert error < TOLERANCE * scale, (name, error)


def spread(angle, a, b):
    u, v = normal(angle), tangent(angle)
    return a * u * u.T + b * v * v.T


def contact(c, P, beta):
    n = normal(beta)
    return c + P * P * n / mp.norm(P * n)


def curvature_radius(P, beta):
    return mp.det(P) ** 2 / mp.norm(P * normal(beta)) ** 3


def smooth():
    """(3), (4), (7): the contact point is where the support function's tangent touches; radius of curvature; derivatives by P."""
    c = mp.matrix([rand(-1, 1), rand(-1, 1)])
    P = spread(rand(0, 3), rand(1, 3), rand(0.5, 2))
    beta = rand(-3, 3)
    n, t = normal(beta), tangent(beta)
    height = lambda b: dot(normal(b), c) + mp.norm(P * normal(b))
    p = contact(c, P, beta)
    close("n·p = h", dot(n, p), height(beta))
    close("t·p = h'", dot(t, p), slope(height, beta))
    inverse = P ** -1
    close("on the ellipse", mp.norm(inverse * (p - c)), mp.mpf(1))
    rho = curvature_radius(P, beta)
    close("(3)", slope(lambda b: contact(c, P, b), beta), rho * t)
    rho_by = -3 * rho * dot(P * n, P * t) / mp.norm(P * n) ** 2
    close("rho'", slope(lambda b: curvature_radius(P, b), beta), rho_by, 100)
    close("(4)", slope(lambda b: curvature_radius(P, b) * tangent(b), beta), rho_by * t - rho * n, 100)
    q = P * n
    unit = q / mp.norm(q)
    for d in ([1, 0, 0, 0], [0, 1, 1, 0], [0, 0, 0, 1]):
        dP = mp.matrix([[d[0], d[1]], [d[2], d[3]]])
        by = dP * unit + P * (mp.eye(2) - unit * unit.T) * dP * n / mp.norm(q)
        close("(7)", slope(lambda s: contact(c, P + s * dP, beta), mp.mpf(0)), by, 10)


def faces():
    """(5): how a face's normal turns with its corners."""
    a, b = mp.matrix([rand(-1, 1), rand(-1, 1)]), mp.matrix([rand(2, 3), rand(-1, 1)])
    turn = lambda e: mp.atan2(-e[0], e[1])  # of the outward normal (e_y, −e_x)
    edge = b - a
    n = normal(turn(edge))
    assert abs(dot(n, edge)) < TOLERANCE and n[0] * edge[1] - n[1] * edge[0] > 0
    for d in (mp.matrix([1, 0]), mp.matrix([0, 1])):
        close("(5)", slope(lambda s: turn(edge + s * d), mp.mpf(0)), -dot(n, d) / mp.norm(edge), 10)


def elimination():
    """(6): the squared distance's derivative by the parameters, the place on the curve following its minimum."""
    c = mp.matrix([rand(-1, 1), rand(-1, 1)])
    r = rand(2, 3)
    beta = rand(-3, 3)
    L = mp.matrix([[rand(0.5, 1), 0, 0], [rand(-1, 1), rand(0.5, 1), 0], [rand(-1, 1), rand(-1, 1), rand(0.5, 1)]])
    W = L ** -1
    y = list(c + r * normal(beta)) + [beta]
    y = mp.matrix([y[i] + rand(-0.2, 0.2) for i in range(3)])

    def residual(r, b):
        p = c + r * normal(b)
        return W * (y - mp.matrix([p[0], p[1], b]))

    def way(r, b):
        t = tangent(b)
        return W * mp.matrix([r * t[0], r * t[1], 1])

    def nearest(r):
        return mp.findroot(lambda b: dot(way(r, b), residual(r, b)), beta)

    def squared(r):
        return mp.norm(residual(r, nearest(r))) ** 2

    b = nearest(r)
    e, w = residual(r, b), way(r, b)
    n = normal(b)
    by = W * mp.matrix([n[0], n[1], 0])
    J = by - w * dot(w, by) / dot(w, w)
    close("(6)", slope(squared, r, mp.mpf("1e-15")), -2 * dot(J, e - w * dot(w, e) / dot(w, w)), 100)
    half = lambda b: mp.norm(residual(r, b)) ** 2 / 2
    bend = W * mp.matrix([-r * n[0], -r * n[1], 0])
    close("Newton", (half(b + mp.mpf("1e-10")) - 2 * half(b) + half(b - mp.mpf("1e-10"))) * mp.mpf("1e20"), dot(w, w) - dot(e, bend), 1000)


def along_the_whisker():
    """Section 1: moved along the whisker a contact keeps its supporting line; so n·x errs only by the product of two errors."""
    x, y, a, d, beta, rho = sp.symbols("x y a d beta rho", real=True)
    n = lambda b: sp.Matrix([sp.cos(b), sp.sin(b)])
    t = sp.Matrix([-sp.sin(beta), sp.cos(beta)])
    c = sp.Matrix([x, y])
    seen = c + rho * n(beta) + a * t
    misfit = (n(beta + d).T * (seen - c))[0] - rho
    assert sp.simplify(misfit.subs(d, 0)) == 0
    assert sp.simplify(sp.diff(misfit, d).subs({d: 0, a: 0})) == 0


def losses():
    """(9), (10): weights are derivatives; the leading loss is smooth where it turns linear."""
    D, c, k = sp.symbols("D c k", positive=True)
    floor = sp.exp(-c / 2)
    final = -2 * sp.log((sp.exp(-D / 2) + floor) / (1 + floor))
    assert sp.simplify(sp.diff(final, D) - sp.exp(-D / 2) / (sp.exp(-D / 2) + floor)) == 0
    assert sp.simplify(final.subs(D, 0)) == 0
    linear = 2 * sp.sqrt(k * D) - k
    assert sp.simplify(linear.subs(D, k) - k) == 0 and sp.simplify(sp.diff(linear, D) - sp.sqrt(k / D)) == 0


def ellipse_to_first_order():
    """(11): |P n| = nᵀ P n up to the square of the eccentricity."""
    e, psi = sp.symbols("e psi", real=True)
    n = sp.Matrix([sp.cos(psi), sp.sin(psi)])
    P = sp.diag(1 + e, 1 - e)
    difference = sp.sqrt((n.T * P * P * n)[0]) - (n.T * P * n)[0]
    assert sp.simplify(difference.subs(e, 0)) == 0 and sp.simplify(sp.diff(difference, e).subs(e, 0)) == 0


def osculating():
    """(15): place, normal and curvature of the circle, at any ratio and direction."""
    c0, r, beta = mp.matrix([rand(-1, 1), rand(-1, 1)]), rand(1, 3), rand(-3, 3)
    kappa = rand(1, 2)
    U = spread(rand(0, 3), mp.sqrt(kappa), 1 / mp.sqrt(kappa))
    n = normal(beta)
    m = r * mp.norm(U * n) ** 3
    c = c0 + r * n - m * U * U * n / mp.norm(U * n)
    close("(15) place", contact(c, m * U, beta), c0 + r * n, 10)
    close("(15) curvature", curvature_radius(m * U, beta), r, 10)


def correlated():
    """(16), (17): the sum of φ^k, and the variance of a sum of correlated errors against that of independent ones."""
    phi, k = sp.symbols("phi k", positive=True)
    tail = phi / (1 - phi)  # Σ_{k ≥ 1} φ^k
    assert sp.simplify(sp.series(tail, phi, 0, 8).removeO() - sum(phi**j for j in range(1, 8))) == 0
    assert sp.simplify(1 + 2 * tail - (1 + phi) / (1 - phi)) == 0
    n, f = 4000, mp.mpf("0.7")
    variance = (n + 2 * sum((n - j) * f**j for j in range(1, n))) / n
    assert abs(variance - (1 + f) / (1 - f)) < mp.mpf(20) / n


for _ in range(5):
    smooth()
    faces()
    elimination()
    osculating()
along_the_whisker()
losses()
ellipse_to_first_order()
correlated()
print("whisker_identify: (1), (3)-(7), (9)-(11), (15)-(17) hold")
