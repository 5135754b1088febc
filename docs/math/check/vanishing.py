"""Checks docs/math/vanishing.md: derivatives and lengths symbolically, the motion of the pose at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import expm, matrix, mp, mpf, norm

mp.dps = 50
random.seed(4)

vec = lambda n: sp.Matrix(sp.symbols(f"{n}1:4", real=True))
u, a, w, c, e = vec("u"), vec("a"), vec("w"), vec("c"), vec("e")
s = sp.Symbol("s", real=True)

# (3): a small rotation moves u . a by w . (u x a); arcsin and atan2.
assert sp.expand((w.cross(u)).dot(a) - w.dot(u.cross(a))) == 0
sine, cosine = (u + s * w.cross(u)).dot(a), (c + s * w.cross(c)).dot(e)
stated = (cosine * w.dot(u.cross(a)) - sine * w.dot(c.cross(e))) / (sine**2 + cosine**2)
assert sp.simplify((sp.diff(sp.atan2(sine, cosine), s) - stated).subs(s, 0)) == 0
x = sp.Symbol("x", real=True)
assert sp.simplify(sp.diff(-sp.asin(x), x) + 1 / sp.sqrt(1 - x**2)) == 0

# (4): the ray of a camera at (0, 0, 1) meets the ground; the ray to a post's top gives its height, and in plan the nearest point.
q = vec("q")
at = -q[0:2, 0] / q[2]
point = sp.Matrix([0, 0, 1]) - q / q[2]
assert point[2].simplify() == 0 and (point[0:2, 0] - at).applyfunc(sp.simplify) == sp.zeros(2, 1)
X, Y, H, k, t = sp.symbols("X Y H k t", positive=True)
ray = k * sp.Matrix([X, Y, H - 1])
plan = sp.Matrix([X, Y])
assert sp.simplify(1 + ray[2] * plan.dot(ray[0:2, 0]) / ray[0:2, 0].dot(ray[0:2, 0]) - H) == 0
distance = (t * ray[0:2, 0] - plan).dot(t * ray[0:2, 0] - plan)
assert sp.simplify(sp.solve(sp.diff(distance, t), t)[0] - plan.dot(ray[0:2, 0]) / ray[0:2, 0].dot(ray[0:2, 0])) == 0

# (6): t = -h u; the left motion (w, d t) with a small w and d of ln h, to first order.
number = lambda: mpf(random.randint(-999, 999)) / 317
cross = lambda v: matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
rotation = expm(cross([number() for _ in range(3)]))
up, h = rotation[:, 2], mpf("6.2")
translation = -h * up
turn, grow = [number() for _ in range(3)], number()
small = mpf(10) ** -20
turned = expm(cross(turn) * small) * up
exact = -h * (1 + small * grow) * turned
stated = translation + small * (cross(turn) * translation + grow * translation)
assert norm(exact - stated) < 1000 * small**2

print("vanishing.md: equations (3), (4), (6) hold")
