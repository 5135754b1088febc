"""Checks docs/math/upright_p2p.md: its identities symbolically, its poses at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import det, matrix, mp, mpf, norm, qr, sqrt

mp.dps = 50
random.seed(8)
TINY = mpf(10) ** -40

# (3): g.m = 0 and g.f = p for p = |g x w|, w of unit length (|g x w|^2 = |g|^2 - (g.w)^2, Lagrange).
g, w = (sp.Matrix(sp.symbols(f"{s}1:4", real=True)) for s in "gw")
level = g.cross(w)
assert sp.expand(g.dot(level)) == 0
ww = w.dot(w)
assert sp.expand(g.dot(w.cross(level)) - (g.dot(g) * ww - g.dot(w) ** 2)) == 0
assert sp.expand(level.dot(level) - (g.dot(g) * ww - g.dot(w) ** 2)) == 0

# (5): the depths of a chord in the plane of the rays.
a, b = (sp.Matrix(sp.symbols(f"{s}1:4", real=True)) for s in "ab")
la, lb = sp.symbols("la lb", real=True)
chord, normal = b * lb - a * la, a.cross(b)
assert sp.expand(chord.cross(normal).dot(b) - la * normal.dot(normal)) == 0
assert sp.expand(chord.cross(normal).dot(a) - lb * normal.dot(normal)) == 0


def rand(n, size=1):
    return matrix([mpf(random.uniform(-size, size)) for _ in range(n)])


def dot(x, y):
    return (x.T * y)[0]


def cross(x, y):
    return matrix([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


def unit(x):
    return x / norm(x)


def rotation():
    q, _ = qr(matrix([[mpf(random.gauss(0, 1)) for _ in range(3)] for _ in range(3)]))
    return q * det(q)


def poses(rays, points, up, w):
    """Section 1; without the test of the depths."""
    (a, b), (A, B) = rays, points
    D = B - A
    h = dot(up, D)
    d = D - up * h
    g = cross(a, b)
    q, p = dot(g, w), norm(cross(g, w))
    m = cross(g, w) / p
    f = cross(w, m)
    k = -q * h / p
    s = sqrt(dot(d, d) - k**2)
    found = []
    for sign in (1, -1):
        c = f * k + m * (s * sign)
        C = w * h + c
        la, lb = dot(cross(C, g), b) / dot(g, g), dot(cross(C, g), a) / dot(g, g)
        R = w * up.T + (c * d.T + cross(w, c) * cross(up, d).T) / dot(d, d)
        found.append((R, a * la - R * A, la, lb))
    return found


ambiguous = 0
for i in range(300):
    R, t, up = rotation(), rand(3, 3), unit(rand(3))
    points = [rand(3), rand(3)]
    if i % 3 == 0:  # points of one height
        points[1] -= up * dot(up, points[1] - points[0])
    seen = [R * x + t for x in points]
    found = poses([unit(x) for x in seen], points, up, R * up)
    assert min(norm(f[0] - R) + norm(f[1] - t) for f in found) < TINY
    for turn, shift, la, lb in found:
        # Every root is a pose: a rotation that keeps the vertical and puts both points on their lines.
        assert norm(turn.T * turn - mp.eye(3)) + abs(det(turn) - 1) + norm(turn * up - R * up) < TINY
        for x, y, depth in zip(points, seen, (la, lb)):
            assert norm(turn * x + shift - unit(y) * depth) < TINY
    in_front = sum(f[2] > 0 and f[3] > 0 for f in found)
    assert in_front >= 1
    if i % 3 == 0:  # section 2: one height, one candidate
        assert in_front == 1 and abs(found[0][2] + found[1][2]) + abs(found[0][3] + found[1][3]) < TINY
    ambiguous += in_front == 2

# Section 2: both rays in the horizon leave every chord of length rho; the depths change with the turn.
w = matrix([0, 0, 1])
a, b = unit(matrix([mpf(3), 1, 0])), unit(matrix([mpf(2), -1, 0]))
assert abs(dot(cross(a, b), matrix([mpf(5), 7, 0]))) < TINY

print(f"upright_p2p.md: all equations hold; two candidates in front in {ambiguous} of 200 problems with different heights")
