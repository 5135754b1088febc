"""Checks docs/math/pure_rotation.md: (4), (5) symbolically, (2), (6), (7) at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import det, diff, eye, inverse, matrix, mp, mpf, norm, qr

mp.dps = 50
random.seed(9)
TINY = mpf(10) ** -40

# (4): the four stationary values of the trace are its roots.  (5): every singular value becomes 1.
s = sp.symbols("s1:4", real=True)
x = sp.symbols("x")
F = sum(v**2 for v in s)
G = s[0] ** 2 * s[1] ** 2 + s[1] ** 2 * s[2] ** 2 + s[2] ** 2 * s[0] ** 2
D = s[0] * s[1] * s[2]
values = [s[0] + s[1] + s[2], s[0] - s[1] - s[2], -s[0] + s[1] - s[2], -s[0] - s[1] + s[2]]
product = sp.prod([x - v for v in values])
assert sp.expand(product - (x**4 - 2 * F * x**2 - 8 * D * x + F**2 - 4 * G)) == 0
lam = values[0]
kappa = (lam**2 - F) / 2
zeta = kappa * lam - D
assert sp.expand(zeta - (s[0] + s[1]) * (s[1] + s[2]) * (s[2] + s[0])) == 0
for i in range(3):
    j, k = (i + 1) % 3, (i + 2) % 3
    assert sp.expand((kappa + F) * s[i] + lam * s[j] * s[k] - s[i] ** 3 - zeta) == 0

# (7)
l2, l3 = sp.symbols("l2 l3")
l1 = 1 - l2 - l3
assert sp.expand(l1 * l2 + l2 * l3 + l3 * l1 - (l2 + l3 - (l2**2 + l2 * l3 + l3**2))) == 0


def dot(x, y):
    return (x.T * y)[0]


def cross(x, y):
    return matrix([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


def rotation():
    q, _ = qr(matrix([[mpf(random.gauss(0, 1)) for _ in range(3)] for _ in range(3)]))
    return q * det(q)


def unit(size=None):
    v = matrix([mpf(random.gauss(0, 1)) for _ in range(3)])
    return v / norm(v)


def hat(w):
    return matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exp(w):
    term, total = eye(3), eye(3)
    for i in range(1, 40):
        term = term * hat(w) / i
        total += term
    return total


def cof(B):
    c = [B[:, i] for i in range(3)]
    out = matrix(3, 3)
    for i in range(3):
        out[:, i] = cross(c[(i + 1) % 3], c[(i + 2) % 3])
    return out


def closed_form(a, b, w):
    W = sum(w)
    B = matrix(3, 3)
    for x, y, v in zip(a, b, w):
        B += y * x.T * (v / W)
    f, g, d = sum(v**2 for v in B), sum(v**2 for v in cof(B)), det(B)
    lam = mpf(1)
    for _ in range(300):
        lam -= (lam**4 - 2 * f * lam**2 - 8 * d * lam + f**2 - 4 * g) / (4 * lam**3 - 4 * f * lam - 8 * d)
    kappa = (lam**2 - f) / 2
    return (B * (kappa + f) + cof(B) * lam - B * B.T * B) / (kappa * lam - d), lam


for n in (2, 3, 8):
    for noise in (mpf(0), mpf(10) ** -3, mpf("0.1")):
        for _ in range(6):
            R = rotation()
            a = [unit() for _ in range(n)]
            b = [R * x + unit() * noise for x in a]
            b = [y / norm(y) for y in b]
            w = [mpf(random.uniform(0.2, 2)) for _ in a]
            Q, lam = closed_form(a, b, w)
            assert norm(Q.T * Q - eye(3)) + abs(det(Q) - 1) < mpf(10) ** -20
            chi2 = lambda M: sum(v * norm(y - M * x) ** 2 for x, y, v in zip(a, b, w))
            assert abs(chi2(Q) - 2 * sum(w) * (1 - lam)) < mpf(10) ** -20  # (2), (3)
            if noise == 0:
                assert norm(Q - R) < mpf(10) ** -20
            # (6): gradient (half, negative) and Hessian (half) of chi2 by a left turn, at the truth, not only at the optimum.
            gradient = sum((cross(R * x, y) * v for x, y, v in zip(a, b, w)), matrix(3, 1))
            hessian = matrix(3, 3)
            for x, y, v in zip(a, b, w):
                yx = (R * x) * y.T
                hessian += (eye(3) * dot(R * x, y) - (yx + yx.T) / 2) * v
            for i in range(3):
                axis = matrix([1 if j == i else 0 for j in range(3)])
                along = lambda t: chi2(exp(axis * t) * R)
                h = mpf(10) ** -12
                assert abs((along(h) - along(-h)) / (2 * h) + 2 * gradient[i]) < mpf(10) ** -15
                assert abs((along(h) - 2 * along(mpf(0)) + along(-h)) / h**2 - 2 * hessian[i, i]) < mpf(10) ** -15
            # No turn does better.
            for _ in range(5):
                assert chi2(Q) <= chi2(exp(unit() * mpf(random.uniform(0, 3))) * Q) + TINY

print("pure_rotation.md: all equations hold; the closed form is the minimum")
