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

# (6): the normal of the horizon's plane is parallel to u where both bearings are level.
b1, b2 = vec("b"), vec("d")
assert (b1.cross(b2).cross(u) - (b1.dot(u) * b2 - b2.dot(u) * b1)).applyfunc(sp.expand) == sp.zeros(3, 1)

# (8): a camera tilted by t about its x axis, y down: the horizon is level, upright lines meet at u.
f, tilt = sp.Symbol("f", positive=True), sp.Symbol("tilt", positive=True)
level, upward = sp.Matrix([0, -sp.sin(tilt), sp.cos(tilt)]), sp.Matrix([0, -sp.cos(tilt), -sp.sin(tilt)])
assert sp.simplify(level.dot(upward)) == 0
p_h, p_u = f * level[1] / level[2], f * upward[1] / upward[2]
assert sp.simplify(p_h * p_u + f**2) == 0

# (7): the sum of squares is that of the equations on the left of (6), whitened, up to a part of the order of the residuals.
number = lambda: mpf(random.randint(-999, 999)) / 317
product = lambda v, w: matrix([v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]])
dot = lambda v, w: sum(v[i] * w[i] for i in range(3))
for scale in [mpf(10) ** -6, mpf(10) ** -9]:
    x, y, z = matrix([1, 0, 0]), matrix([0, 1, 0]), matrix([0, 0, 1])
    bearings = [matrix([number(), number(), scale * number()]) for _ in range(2)]
    bearings = [b / norm(b) for b in bearings]
    slopes = [matrix(3, 2) for _ in range(2)]
    for b, slope in zip(bearings, slopes):
        across = product(b, matrix([number(), number(), number()]))
        columns = [number() * across / norm(across), product(b, across) / norm(across)]
        for i in range(3):
            slope[i, 0], slope[i, 1] = columns[0][i], columns[1][i]
    on_right = sum(dot(b, z) ** 2 / norm(slope.T * z) ** 2 for b, slope in zip(bearings, slopes))
    normal = product(*bearings)
    rows = []
    for d in [x, y]:
        by = [slopes[0].T * product(bearings[1], d), slopes[1].T * product(d, bearings[0])]
        rows.append([by[0][0], by[0][1], by[1][0], by[1][1]])
    jacobian, g = matrix(rows), matrix([dot(normal, x), dot(normal, y)])
    on_left = (g.T * (jacobian * jacobian.T) ** -1 * g)[0]
    assert abs(on_left / on_right - 1) < 1000 * scale

# (9): t = -h u; the left motion (w, d t) with a small w and d of ln h, to first order.
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

print("vanishing.md: equations (3), (4), (6) to (9) hold")
