"""Checks docs/math/pose.md: series and closed forms symbolically, the group laws and the covariances at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import expm, inverse, matrix, mp, mpf, norm

mp.dps = 50
random.seed(1)
TINY = mpf(10) ** -45


def sym_cross(w):
    return sp.Matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


# (5): coefficients and their series; (8): the one of Log.
t = sp.symbols("theta", positive=True)
a, b, c = sp.sin(t) / t, (1 - sp.cos(t)) / t**2, (t - sp.sin(t)) / t**3
series = lambda f, n: sp.series(f, t, 0, n).removeO()
assert sp.simplify(series(a, 6) - (1 - t**2 / 6 + t**4 / 120)) == 0
assert sp.simplify(series(b, 6) - (sp.Rational(1, 2) - t**2 / 24 + t**4 / 720)) == 0
assert sp.simplify(series(c, 6) - (sp.Rational(1, 6) - t**2 / 120 + t**4 / 5040)) == 0
d = (1 - a / (2 * b)) / t**2
assert sp.simplify(series(d, 6) - (sp.Rational(1, 12) + t**2 / 720 + t**4 / 30240)) == 0
s = sp.symbols("s", positive=True)
assert sp.simplify(sp.series(2 * sp.asin(s) / s, s, 0, 6).removeO() - (2 + s**2 / 3 + 3 * s**4 / 20)) == 0

# (8): (I + bK + cK^2)(I - K/2 + dK^2) = I, by K^3 = -theta^2 K.
k, B, C, D = sp.symbols("k B C D")
product = sp.expand((1 + B * k + C * k**2) * (1 - k / 2 + D * k**2) - 1)
remainder = sp.Poly(sp.rem(product, k**3 + t**2 * k, k), k)
values = {B: b, C: c, D: d}
assert all(sp.simplify(x.subs(values).rewrite(sp.tan).simplify()) == 0 for x in remainder.all_coeffs())


def cross(w):
    return matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def hat(xi):
    m = matrix(4, 4)
    m[0:3, 0:3] = cross(xi[:3])
    for i in range(3):
        m[i, 3] = xi[3 + i]
    return m


def exp(xi):
    w, v = xi[:3], matrix(xi[3:])
    th = mp.sqrt(sum(x * x for x in w))
    K = cross(w)
    if th == 0:
        R, V = mp.eye(3), mp.eye(3)
    else:
        R = mp.eye(3) + K * (mp.sin(th) / th) + K * K * ((1 - mp.cos(th)) / th**2)
        V = mp.eye(3) + K * ((1 - mp.cos(th)) / th**2) + K * K * ((th - mp.sin(th)) / th**3)
    m = mp.eye(4)
    m[0:3, 0:3] = R
    tr = V * v
    for i in range(3):
        m[i, 3] = tr[i]
    return m


def adjoint(m):
    R, tr = m[0:3, 0:3], [m[i, 3] for i in range(3)]
    ad = matrix(6, 6)
    ad[0:3, 0:3] = R
    ad[3:6, 3:6] = R
    ad[3:6, 0:3] = cross(tr) * R
    return ad


def rand(n, size=1):
    return [mpf(random.uniform(-size, size)) for _ in range(n)]


for _ in range(20):
    xi, eta = rand(6, 2), rand(6)
    p = exp(xi)
    # (4) is the exponential of the 4x4 matrix.
    assert norm(p - expm(hat(xi), method="taylor")) < TINY
    # (9): b_from_a Exp(eta) = Exp(Ad eta) b_from_a.
    assert norm(p * exp(eta) - exp(list(adjoint(p) * matrix(eta))) * p) < TINY
    assert norm(adjoint(inverse(p)) - inverse(adjoint(p))) < TINY
    # (11), (12): exactly, for motions of any size.
    small, other = rand(6), rand(6)
    moved_inverse = inverse(exp(small) * p)
    assert norm(moved_inverse - exp([-x for x in adjoint(inverse(p)) * matrix(small)]) * inverse(p)) < TINY
    q = exp(rand(6, 2))
    moved_product = exp(small) * q * exp(other) * p
    assert norm(moved_product - exp(small) * exp(list(adjoint(q) * matrix(other))) * q * p) < TINY

# (13), (14): first order of the camera's place and of the target's origin.
w, v, tt = (sp.Matrix(sp.symbols(f"{n}1:4")) for n in ("w", "v", "t"))
h = sp.symbols("h")
R = sp.Matrix(sp.Matrix(3, 3, sp.symbols("r1:10")))
moved_t = tt + h * (sym_cross(w) * tt + v)
origin_in_target_by_r = -(sp.eye(3) - h * sym_cross(w)) * moved_t  # R C' with R' = (I + h [w]x) R, R'^T = R^T (I - h [w]x)
assert sp.expand(origin_in_target_by_r.diff(h).subs(h, 0) + v) == sp.zeros(3, 1)
assert sp.expand(moved_t.diff(h) - (v + w.cross(tt))) == sp.zeros(3, 1)
assert sp.expand(w.cross(tt) - (-sym_cross(tt)) * w) == sp.zeros(3, 1)

# The squared chord of two rotations is 8 sin^2(theta/2): twice theta^2 for small angles.
rotation = sp.Matrix([[sp.cos(t), -sp.sin(t), 0], [sp.sin(t), sp.cos(t), 0], [0, 0, 1]])
chord = sum(x**2 for x in rotation - sp.eye(3))
assert sp.simplify(chord - 8 * sp.sin(t / 2) ** 2) == 0

print("pose.md: all equations hold")
