"""Checks docs/math/two_view.md: (3), the conditions (5) and (6), (7) by an exact example, (8), (10) by integration, (15)-(17) by differentiation, and the
cancellation behind (11). Needs mpmath."""

import random

from mpmath import cos, det, diff, eye, matrix, mp, mpf, npdf, quad, sin, sqrt

mp.dps = 50
random.seed(3)
TINY = mpf(10) ** -25


def rnd():
    return mpf(random.uniform(-1, 1))


def vector(*x):
    return matrix([mpf(v) for v in x])


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def cross(a, b):
    return matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def unit(a):
    return a / sqrt(dot(a, a))


def skew(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exp_so3(w):
    k, total, term = skew(w), eye(3), eye(3)
    for n in range(1, 60):
        term = term * k / n
        total = total + term
    return total


r, t = exp_so3(vector("0.1", "-0.3", "0.2")), unit(vector("0.3", "-0.1", "-1"))
e = skew(t) * r

# (1)-(3): depths of an exact pair.
x = vector("0.7", "-0.4", "3")
a, b = unit(x), unit(r * x + t)
y = r * a
c = cross(y, b)
assert abs(dot(b, e * a)) < TINY
assert abs(-dot(cross(t, b), c) / dot(c, c) - sqrt(dot(x, x))) < TINY
z = r * x + t
assert abs(-dot(cross(t, y), c) / dot(c, c) - sqrt(dot(z, z))) < TINY

# (5), (6): both vanish on an essential matrix, and (5) does not on another one.
square = e * e.T
assert max(abs(v) for v in square * e - e * ((square[0, 0] + square[1, 1] + square[2, 2]) / 2)) < TINY
assert abs(det(e)) < TINY

# (8): all four poses have that essential matrix up to its sign.
u3 = t
u1 = unit(cross(t, vector(1, 0, 0)))
u2 = cross(u3, u1)
u = matrix([[u1[i], u2[i], u3[i]] for i in range(3)])
w = matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
# E = U diag(1,1,0) V^T has V^T = Z-rotation times U^T R for [t]x = U Z U^T.
zed = matrix([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
assert max(abs(v) for v in u * zed * u.T - skew(t)) < TINY
v_t = w * u.T * r
for turn in (w, w.T):
    rotation = u * turn * v_t
    for sign in (1, -1):
        other = skew(sign * t) * rotation
        near = min(max(abs(v) for v in other - e), max(abs(v) for v in other + e))
        assert near < TINY, near

# (7): multiplication by x in the basis of monomials, on a variety of points: the matrix has them as eigenvectors whatever the cubics, as the monomials
# of degree three are linear in the ten others there. Ten points, ten monomials.
points = [(rnd(), rnd(), rnd()) for _ in range(10)]
basis = lambda p: [p[0], p[1], p[2], mpf(1), p[0] ** 2, p[0] * p[1], p[0] * p[2], p[1] ** 2, p[1] * p[2], p[2] ** 2]
values = matrix([basis(p) for p in points])
action = (values ** -1 * matrix([[p[0] * m for m in basis(p)] for p in points])).T
for p in points:
    m = matrix(basis(p))
    assert max(abs(v) for v in action * m - p[0] * m) < mpf(10) ** -30

# (10).
k = 3.2905
limit = mpf("3.290527")
kept = quad(lambda z: z * z * npdf(z), [-limit, 0, limit]) / quad(npdf, [-limit, 0, limit])
formula = 1 - 2 * limit * npdf(limit) / quad(npdf, [-limit, 0, limit])
assert abs(kept - formula) < TINY and abs(kept - mpf("0.988293")) < mpf("5e-7"), kept

# (15)-(17) by differentiation, a pair that is off its epipolar line.
s1, s2 = mpf("0.02"), mpf("0.03")
b = unit(b + vector("0.02", "0.05", "-0.01"))


def of(w, shift):
    yy, tt = exp_so3(w) * y, t + shift
    value = dot(b, cross(tt, yy))
    tt = tt / sqrt(dot(tt, tt))
    unit_value = dot(b, cross(tt, yy))
    ty, tb = dot(tt, yy), dot(tt, b)
    return value, s2**2 * (1 - ty**2 - unit_value**2) + s1**2 * (1 - tb**2 - unit_value**2)


value = dot(b, cross(t, y))
by_turn, by_t = cross(y, cross(b, t)), cross(y, b)
common = -2 * value * (s1**2 + s2**2)
v_by_turn = -2 * s2**2 * dot(t, y) * cross(y, t) + common * by_turn
v_by_t = -2 * s2**2 * dot(t, y) * y - 2 * s1**2 * dot(t, b) * b + common * by_t
across = [unit(cross(t, vector(0, 1, 0)))]
across.append(cross(t, across[0]))
zero = matrix(3, 1)
for i in range(3):
    axis = matrix(3, 1)
    axis[i] = 1
    assert abs(diff(lambda h: of(h * axis, zero)[0], 0) - by_turn[i]) < TINY * 10**10
    assert abs(diff(lambda h: of(h * axis, zero)[1], 0) - v_by_turn[i]) < TINY * 10**10
for axis in across:
    assert abs(diff(lambda h: of(zero, h * axis)[0], 0) - dot(by_t, axis)) < TINY * 10**10
    assert abs(diff(lambda h: of(zero, h * axis)[1], 0) - dot(v_by_t, axis)) < TINY * 10**10

# The cancellation behind (11): for an error across the epipolar line alone, the derivative of r by t is zero to first order in the error.
f = unit(vector("0.3", "0.2", "1"))
normal = unit(cross(t, f))


def slope(h, axis):
    y0, b0 = f, unit(f + h * normal)

    def residual(g):
        tt = unit(t + g * axis)
        value = dot(b0, cross(tt, y0))
        v = s2**2 * (1 - dot(tt, y0) ** 2 - value**2) + s1**2 * (1 - dot(tt, b0) ** 2 - value**2)
        return value / sqrt(v)

    return diff(residual, 0)


for axis in across:
    assert abs(diff(lambda h: slope(h, axis), 0)) < mpf(10) ** -12
print("two_view.md: all equations hold")
