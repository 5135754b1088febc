"""Checks docs/math/lines.md: derivatives symbolically, closed forms at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import cos, det, matrix, mp, mpf, norm, qr, sin, sqrt

mp.dps = 50
random.seed(10)
TINY = mpf(10) ** -38

vec = lambda n: sp.Matrix(sp.symbols(f"{n}1:4", real=True))
a, b, v, m, e, D, x, y, q, w, nu = (vec(n) for n in ("a", "b", "v", "m", "e", "D", "x", "y", "q", "w", "u"))
Ja, Jb = (sp.Matrix(3, 2, sp.symbols(f"{n}1:7", real=True)) for n in ("J", "K"))
d = sp.Matrix(sp.symbols("p1:3", real=True))
s = sp.Symbol("s", real=True)

# (1), (3): the triple product and what pixel errors do to it.
assert (a.cross(b) - a.cross(b - a)).expand() == sp.zeros(3, 1)
g = a.cross(b).dot(v)
for moved, stated in (((a + Ja * d).cross(b), (Ja * d).dot(b.cross(v))), (a.cross(b + Jb * d), (Jb * d).dot(v.cross(a)))):
    assert sp.expand(moved.dot(v) - g - stated) == 0

# (4): half the derivative of the variance.
ya, yb = Ja.T * b.cross(v), Jb.T * v.cross(a)
variance = ya.dot(ya) + yb.dot(yb)
stated = (Ja * ya).cross(b) + a.cross(Jb * yb)
assert all(sp.expand(sp.diff(variance, v[i]) / 2 - stated[i]) == 0 for i in range(3))

# (6): the derivative of m.e/|J^T m|, at random numbers (the square root makes symbols unwieldy).
rho = m.dot(e) / sp.sqrt((Ja.T * m).dot(Ja.T * m))
across = Ja.T * m
stated = (e - Ja * across * (m.dot(e) / across.dot(across))) / sp.sqrt(across.dot(across))
numbers = {t: sp.Rational(random.randint(-99, 99), 37) for t in [*m, *e, *Ja]}
assert all(sp.simplify((sp.diff(rho, m[i]) - stated[i]).subs(numbers)) == 0 for i in range(3))

# (7): q . dm for m = D x x.
moved = (D + s * w.cross(D)).cross(x + s * (w.cross(y) + nu))
first = sp.expand(sp.diff(sp.expand(q.dot(moved)), s).subs(s, 0))
by_place = q.cross(D)
assert sp.expand(first - (by_place.dot(nu) + (y.cross(by_place) + D.cross(x.cross(q))).dot(w))) == 0


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


for _ in range(100):
    R = rotation()
    # (8): two parallel lines and a third.
    d1, d3 = unit(rand(3)), unit(rand(3))
    n = [unit(cross(R * d, rand(3))) for d in (d1, d1, d3)]
    v = unit(cross(n[0], n[1]))
    p = norm(cross(n[2], v))
    f = unit(v - n[2] * dot(n[2], v))
    assert abs(dot(f, v) - p) < TINY
    turn, cosine = cross(n[2], f), dot(d1, d3)
    best = mpf(10)
    for sign in (1, -1):
        along = cosine * dot(f, v * sign) / p**2
        for side in (1, -1):
            r = f * along + turn * (sqrt(1 - along**2) * side)
            assert abs(dot(r, n[2])) + abs(dot(r, v * sign) - cosine) + abs(norm(r) - 1) < TINY
            best = min(best, norm(r - R * d3) + norm(v * sign - R * d1))
    assert best < TINY

    # (9), (10): the true rotation closes, at its own phi and theta.
    d = [unit(rand(3)) for _ in range(3)]
    n = [unit(cross(R * x, rand(3))) for x in d]
    z = unit(cross(d[0], d[1]))
    frame = [d[0], cross(z, d[0]), z]
    r = R * d[0]
    s = cross(r, n[0])
    # theta: p goes to n1 cos + s sin.
    ct, st = dot(R * frame[1], n[0]), dot(R * frame[1], s)
    assert abs(ct**2 + st**2 - 1) < TINY
    for k in (1, 2):
        X, Y, Z = (dot(d[k], axis) for axis in frame)
        A = X * dot(n[k], r)
        B = Y * dot(n[k], n[0]) + Z * dot(n[k], s)
        C = Y * dot(n[k], s) - Z * dot(n[k], n[0])
        assert abs(A + B * ct + C * st) < TINY
        other = mpf(random.uniform(0, 6))  # and for any theta (9) is the product
        axes = [r, n[0] * cos(other) + s * sin(other), s * cos(other) - n[0] * sin(other)]
        turned = axes[0] * X + axes[1] * Y + axes[2] * Z
        assert abs(dot(n[k], turned) - (A + B * cos(other) + C * sin(other))) < TINY
        if k == 1:
            reach = sqrt(B**2 + C**2 - A**2)
            branches = [matrix([-A * B - t * reach * C, -A * C + t * reach * B]) / (B**2 + C**2) for t in (1, -1)]
            assert min(norm(x - matrix([ct, st])) for x in branches) < TINY

    # In front: lambda has the sign of (D x e).(D x x).
    D, x, lam = R * d[0], rand(3, 4), mpf(random.uniform(-5, 5))
    e = unit((x + D * mpf(random.uniform(-3, 3))) / lam)
    assert mp.sign(dot(cross(D, e), cross(D, x))) == mp.sign(lam)

print("lines.md: all equations hold")
