"""Checks docs/math/triangulate.md: eqs. (1)-(7), (9)-(11), at random points to 40 digits and symbolically. Needs SymPy and mpmath."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(5)


def rand(rows, cols=1, size=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)) * size)


def dot(a, b):
    return (a.T * b)[0]


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def pinhole(x):
    return mp.matrix([700 * x[0] / x[2] + 3, 710 * x[1] / x[2] - 2])


def jacobian(f, at, h=mp.mpf("1e-15")):
    columns = []
    for i in range(len(at)):
        step = mp.zeros(len(at), 1)
        step[i] = h
        columns.append((f(at + step) - f(at - step)) / (2 * h))
    return mp.matrix([[c[r] for c in columns] for r in range(len(columns[0]))])


# (1): the derivative of the pixel by the left motion is J [-[x]x I].
x = rand(3) + mp.matrix([0, 0, 5])
by_point = jacobian(pinhole, x)
by_motion = jacobian(lambda m: pinhole(x + cross(m[:3], x) + m[3:]), mp.zeros(6, 1))
k = -hat(x)
expected = mp.zeros(2, 6)
left = by_point * k
for r in range(2):
    for c in range(3):
        expected[r, c], expected[r, 3 + c] = left[r, c], by_point[r, c]
assert mp.norm(by_motion - expected) < mp.mpf("1e-20")

# (2): for a pinhole the chart by the camera's x and y is exact, however large y.
bearing = x / mp.norm(x)
metric = jacobian(pinhole, bearing)[:, :2]
y = rand(2, size=mp.mpf("0.3"))
direction = bearing + mp.matrix([y[0], y[1], 0])
assert mp.norm(pinhole(direction) - (pinhole(bearing) + metric * y)) < mp.mpf("1e-18")

# (3), (4): the nearest point of the line in the metric, by Lagrange's condition and its cost.
root = rand(2, 2)
sigma = root * root.T
n = rand(3)
p, l = dot(n, bearing), n[:2]
q = dot(l, sigma * l)
y = sigma * l * (-p / q)
assert abs(p + dot(l, y)) < mp.mpf("1e-30")
gradient = sigma**-1 * y
assert abs(gradient[0] * l[1] - gradient[1] * l[0]) < mp.mpf("1e-30")
assert abs(dot(y, gradient) - p**2 / q) < mp.mpf("1e-30")

# (5), (6): symbolically; the numerator of one view has degree 2, of both 6.
t, p0, p1, q0, q1, q2, r0, r1, s0, s1, s2 = sp.symbols("t p0 p1 q0 q1 q2 r0 r1 s0 s1 s2")
pa, qa, pb, qb = p0 + p1 * t, q0 + q1 * t + q2 * t**2, r0 + r1 * t, s0 + s1 * t + s2 * t**2


def numerator(p0, p1, q0, q1, q2):
    return (p0 + p1 * t) * ((2 * p1 * q0 - p0 * q1) + (p1 * q1 - 2 * p0 * q2) * t)


na, nb = numerator(p0, p1, q0, q1, q2), numerator(r0, r1, s0, s1, s2)
assert sp.expand(sp.diff(pa**2 / qa, t) * qa**2 - na).simplify() == 0
whole = sp.expand(na * qb**2 + nb * qa**2)
assert sp.simplify(sp.diff(pa**2 / qa + pb**2 / qb, t) * qa**2 * qb**2 - whole) == 0
assert sp.degree(whole, t) == 6

# (7): coplanar rays meet where it says.
c1, c2, place = rand(3), rand(3), rand(3, size=4)
d1, d2 = (place - c1) * mp.mpf("0.3"), (place - c2) * mp.mpf("1.7")
b, normal = c2 - c1, cross(d1, d2)
l1, l2 = dot(cross(b, d2), normal) / dot(normal, normal), dot(cross(b, d1), normal) / dot(normal, normal)
assert mp.norm(c1 + d1 * l1 - place) < mp.mpf("1e-30") and mp.norm(c2 + d2 * l2 - place) < mp.mpf("1e-30")

# (9): rays that meet in front turn as the baseline does: (d1 x d2) . (B x (d1 + d2)) > 0, and < 0 where they diverge.
for _ in range(100):
    c1, c2, place = rand(3), rand(3), rand(3, size=4)
    d1, d2 = place - c1, place - c2
    d1, d2 = d1 / mp.norm(d1), d2 / mp.norm(d2)
    b = c2 - c1
    assert dot(cross(d1, d2), cross(b, d1 + d2)) > 0
    assert dot(cross(-d1, -d2), cross(b, -d1 - d2)) < 0

# (10), (11): covariance of the estimate and of the residuals left by it, for linear views.
views = [(rand(2, 3), (lambda r: r * r.T)(rand(2, 2))) for _ in range(3)]
information = sum((j.T * v**-1 * j for j, v in views), mp.zeros(3))
covariance = information**-1
for i, (ji, vi) in enumerate(views):
    # r_i = e_i - J_i C sum_k J_k' V_k^-1 e_k, the e_k independent with covariance V_k.
    total = mp.zeros(2)
    for k, (jk, vk) in enumerate(views):
        by = (mp.eye(2) if k == i else mp.zeros(2)) - ji * covariance * jk.T * vk**-1
        total += by * vk * by.T
    assert mp.norm(total - (vi - ji * covariance * ji.T)) < mp.mpf("1e-25")

print("triangulate.md: all equations hold")
