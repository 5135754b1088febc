"""Checks docs/math/rig_pose.md: eqs. (3)-(7), symbolically or at random points to 40 digits. Needs SymPy and mpmath."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(2)

# (3): derivative of the pixel by the rig's motion about the pivot, for a pinhole of unit focal length.
wx, wy, wz, vx, vy, vz = motion = sp.symbols("wx wy wz vx vy vz", real=True)
y = sp.Matrix(sp.symbols("y1:4", real=True))
c = sp.Matrix(sp.symbols("c1:4", real=True))
r = sp.Matrix(3, 3, sp.symbols("r1:10", real=True))
t = sp.Matrix(sp.symbols("t1:4", real=True))
w, v = sp.Matrix([wx, wy, wz]), sp.Matrix([vx, vy, vz])
place = r * (y + c + w.cross(y) + v) + t
pixel = sp.Matrix([place[0] / place[2], place[1] / place[2]])
still = {m: 0 for m in motion}
x = r * (y + c) + t
values = {s: random.uniform(1, 2) for s in [*y, *c, *r, *t]}
lens = sp.Matrix([[1 / x[2], 0, -x[0] / x[2] ** 2], [0, 1 / x[2], -x[1] / x[2] ** 2]])
j = lens * r
for row in range(2):
    rows = list(y.cross(j[row, :].T)) + list(j[row, :])
    for m, entry in zip(motion, rows):
        direct = sp.diff(pixel[row], m).subs(still)
        assert abs(sp.N((direct - entry).subs(values), 20)) < 1e-12


def matrix(rows, cols):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)))


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def blocks(a, b, c, d):
    m = mp.zeros(6)
    for i in range(3):
        for k in range(3):
            m[i, k], m[i, 3 + k], m[3 + i, k], m[3 + i, 3 + k] = a[i, k], b[i, k], c[i, k], d[i, k]
    return m


def exp(xi):
    m = mp.zeros(4)
    k = hat(xi[:3])
    for i in range(3):
        for n in range(3):
            m[i, n] = k[i, n]
        m[i, 3] = xi[3 + i]
    return mp.expm(m, method="taylor")


def homogeneous(rotation, translation):
    m = mp.eye(4)
    for i in range(3):
        for k in range(3):
            m[i, k] = rotation[i, k]
        m[i, 3] = translation[i]
    return m


# (4): a small motion of the camera moves its points as the transported motion of the rig about the pivot does.
turn = exp(matrix(6, 1) * mp.mpf("0.3"))
cam_from_rig = homogeneous(turn[:3, :3], matrix(3, 1))
rig_from_cam = cam_from_rig**-1
rotation, shift = rig_from_cam[:3, :3], rig_from_cam[:3, 3]
adjoint = blocks(rotation, mp.zeros(3), hat(shift) * rotation, rotation)
pivot, point = matrix(3, 1), matrix(3, 1)
p = blocks(mp.eye(3), mp.zeros(3), -hat(pivot), mp.eye(3))
zeta = matrix(6, 1) * mp.mpf("1e-12")
moved = exp(zeta) * cam_from_rig * mp.matrix([*point, 1])
rig_motion = p * adjoint * zeta
by_rig = point + hat(rig_motion[:3]) * (point - pivot) + rig_motion[3:]
other = cam_from_rig * mp.matrix([*by_rig, 1])
still = cam_from_rig * mp.matrix([*point, 1])
assert mp.norm(moved - other) < mp.mpf("1e-9") * mp.norm(moved - still)

# (5), (6): elimination of the unknown motion, and the marginal covariance of the residuals.
jac, res = matrix(14, 6), matrix(14, 1)
root = matrix(6, 6)
s = root * root.T
n, g = jac.T * jac, jac.T * res
share = (mp.eye(6) + n * s) ** -1
sigma = (n + s**-1) ** -1 * g
cost = ((res - jac * sigma).T * (res - jac * sigma) + sigma.T * s**-1 * sigma)[0]
chi2 = (res.T * res)[0] - (g.T * s * share * g)[0]
marginal = (mp.eye(14) + jac * s * jac.T) ** -1
assert abs(cost - chi2) < 1e-25 and abs(chi2 - (res.T * marginal * res)[0]) < 1e-25
assert mp.norm(share * g - jac.T * marginal * res) < 1e-25
assert mp.norm(share * n - jac.T * marginal * jac) < 1e-25
assert mp.norm(share * n - (n**-1 + s) ** -1) < 1e-25

# (7): Exp(zeta) cam_from_rig rig_from_target: for one camera the covariance of the rig's pose is N^-1 + S, both carried by Ad.
root = matrix(6, 6)
camera_covariance = root * root.T
information = n
carried = adjoint * (information**-1 + camera_covariance) * adjoint.T
inverse_adjoint = adjoint**-1
in_rig = inverse_adjoint.T * information * inverse_adjoint
assert mp.norm(in_rig**-1 + adjoint * camera_covariance * adjoint.T - carried) < 1e-20

# (8)-(10): elimination of the unknown parameters, alone and after the unknown motion, and the determinant.
by_lens = matrix(14, 4)
half = matrix(4, 3)
c = half * half.T  # Of rank three: no inverse.
for place in (mp.zeros(6), s):
    base = (mp.eye(14) + jac * place * jac.T) ** -1
    q = (mp.eye(6) + n * place) ** -1
    g_lens = q * (jac.T * by_lens)
    m = by_lens.T * by_lens - (jac.T * by_lens).T * place * q * (jac.T * by_lens)
    h = by_lens.T * res - (jac.T * by_lens).T * place * q * (jac.T * res)
    assert mp.norm(m - by_lens.T * base * by_lens) < 1e-20
    assert mp.norm(h - by_lens.T * base * res) < 1e-20
    e = (mp.eye(4) + c * m) ** -1 * c
    whole = (mp.eye(14) + jac * place * jac.T + by_lens * c * by_lens.T) ** -1
    left = (res.T * base * res)[0] - (h.T * e * h)[0]
    assert abs(left - (res.T * whole * res)[0]) < 1e-20
    assert mp.norm(jac.T * base * res - g_lens * e * h - jac.T * whole * res) < 1e-20
    assert mp.norm(jac.T * base * jac - g_lens * e * g_lens.T - jac.T * whole * jac) < 1e-20
    ratio = mp.det(base) / mp.det(whole)
    assert abs(mp.log(ratio) - mp.log(mp.det(mp.eye(4) + m * c))) < 1e-20

print("rig_pose.md: all equations hold")
