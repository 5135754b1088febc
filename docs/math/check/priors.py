"""Checks docs/math/priors.md: transport to the pivot, the inverse left Jacobian, direction and height residuals. Needs SymPy, mpmath."""

import random

import sympy as sp
from mpmath import acos, cos, cot, expm, eye, inverse, matrix, mp, mpf, norm, sin, sqrt, taylor

mp.dps = 50
random.seed(3)
TINY = mpf(10) ** -40


def cross(a):
    return matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def ad(e):
    m = matrix(6, 6)
    m[0:3, 0:3], m[3:6, 3:6], m[3:6, 0:3] = cross(e[0:3]), cross(e[0:3]), cross(e[3:6])
    return m


def hat(e):
    m = matrix(4, 4)
    m[0:3, 0:3] = cross(e[0:3])
    m[0:3, 3] = matrix(e[3:6])
    return m


def rand(n):
    return [mpf(random.uniform(-1, 1)) for _ in range(n)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


# (1): g.w + f.(c x w) = (g + f x c).w
g, f, c, w = (sp.Matrix(sp.symbols(f"{n}1:4")) for n in "gfcw")
assert sp.expand(g.dot(w) + f.dot(c.cross(w)) - (g + f.cross(c)).dot(w)) == 0


# (3), (4): the polynomial is the inverse of J = sum ad^n/(n+1)!, and J relates the exponentials as stated.
def alpha_beta(theta):
    h = theta / 2 * cot(theta / 2)
    th = h - (theta / 2) ** 2 / sin(theta / 2) ** 2  # theta h'
    return (2 - 2 * h + th / 2) / theta**2, (th + 2 - 2 * h) / (2 * theta**4)


def series(a):
    total, term = eye(6), eye(6)
    for n in range(1, 120):
        term = term * a / (n + 1)
        total += term
    return total


for scale in (mpf("0.1"), 1, 2, mpf("2.9")):
    axis = matrix(rand(3))
    e = list(axis / norm(axis) * scale) + rand(3)
    a = ad(e)
    assert norm(a * (a * a + scale**2 * eye(6)) * (a * a + scale**2 * eye(6))) < TINY
    alpha, beta = alpha_beta(scale)
    inv = eye(6) - a / 2 + alpha * a**2 + beta * a**4
    assert norm(inv * series(a) - eye(6)) < TINY
    h = mpf(10) ** -12
    xi = rand(6)
    left = expm(hat([h * x for x in xi])) * expm(hat(e))
    right = expm(hat([x + h * y for x, y in zip(e, inv * matrix(xi))]))
    assert norm(left - right) < mpf(10) ** -22
# h' as used: derivative of (t/2) cot(t/2).
t = sp.symbols("t", positive=True)
h_ = t / 2 * sp.cot(t / 2)
assert sp.simplify(t * h_.diff(t) - (h_ - (t / 2) ** 2 / sp.sin(t / 2) ** 2)) == 0
# The series below 0.05: relative error of the cut.
small = mpf("0.05")
alpha, beta = alpha_beta(small)
assert abs(alpha / (mpf(1) / 12 - small**4 / 30240) - 1) < mpf(10) ** -10
assert abs(beta / (-mpf(1) / 720 - small**2 / 15120) - 1) < mpf(10) ** -6

# (6)-(8): derivative of the arc, against differences at 50 digits.
for _ in range(5):
    m, p, b, turn = matrix(rand(3)), matrix(rand(3)), matrix(rand(3)), matrix(rand(3))
    m, p = m / norm(m), p / norm(p)
    b = b - m * dot(b, m)
    b = b / norm(b)
    second = cross(m) * b

    def arc(q, k):
        angle = acos(dot(m, q))
        return angle / sin(angle) * dot(k, q)

    angle = acos(dot(m, p))
    assert abs(arc(p, b) ** 2 + arc(p, second) ** 2 - angle**2) < TINY
    ff, slope = angle / sin(angle), (angle * cos(angle) - sin(angle)) / sin(angle) ** 3
    exact = dot(ff * (cross(p) * b) + slope * dot(b, p) * (cross(p) * m), turn)
    step = mpf(10) ** -15
    moved = lambda s: expm(cross(s * step * turn)) * p
    assert abs((arc(moved(1), b) - arc(moved(-1), b)) / (2 * step) - exact) < mpf(10) ** -25
assert abs(taylor(lambda x: (x * cos(x) - sin(x)) / sin(x) ** 3, mpf("1e-15"), 0)[0] + mpf(1) / 3) < mpf(10) ** -15

# (9): the camera centre under a left motion.
for _ in range(5):
    R, tt, n, xi = expm(cross(rand(3))), matrix(rand(3)), matrix(rand(3)), rand(6)
    step = mpf(10) ** -15

    def height(s):
        move = expm(hat([s * step * x for x in xi]))
        rotation, shift = move[0:3, 0:3] * R, move[0:3, 0:3] * tt + move[0:3, 3]
        return dot(n, -(rotation.T * shift))

    assert abs((height(1) - height(-1)) / (2 * step) + dot(R * n, xi[3:6])) < mpf(10) ** -25

# (10): the gradient of the sum of squares vanishes at the solution.
b, X, n = [matrix(rand(3)) for _ in range(2)], [matrix(rand(3)) for _ in range(2)], matrix(rand(3))
b = [v / norm(v) for v in b]
R, height, eps = expm(cross(rand(3))), mpf("0.7"), mpf(10) ** -6
P = [eye(3) - v * v.T for v in b]
A = P[0] + P[1] + (R * n) * (R * n).T + 2 * eps * eye(3)
rhs = -(P[0] * R * X[0]) - P[1] * R * X[1] - R * n * height + eps * (b[0] - R * X[0] + b[1] - R * X[1])
T = inverse(A) * rhs


def cost(s):
    rays = sum(norm(P[i] * (R * X[i] + s)) ** 2 + eps * norm(R * X[i] + s - b[i]) ** 2 for i in range(2))
    return rays + (height + dot(R * n, s)) ** 2


step = mpf(10) ** -15
for k in range(3):
    unit = matrix([step if i == k else 0 for i in range(3)])
    assert abs((cost(T + unit) - cost(T - unit)) / (2 * step)) < mpf(10) ** -25

print("priors.md: all equations hold")
