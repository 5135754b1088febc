"""Checks docs/math/vehicle.md: (1), (2) and the derivatives of yaw and pitch, (3) on an arc, (4) and (9) by differentiation, (10), (11), (13), (17) with
the derivatives of yaw, (18) of a linear function, and (7) for errors correlated with the next block. Needs SymPy and mpmath."""

import random

import sympy as sp
from mpmath import cos, diff, eye, matrix, mp, mpf, sin, sqrt

mp.dps = 40
random.seed(4)
TINY = mpf(10) ** -20

# (1), (2): a right-handed frame for every roll; yaw and pitch by x.
psi, theta, phi = sp.symbols("psi theta phi", real=True)
d = sp.Matrix([sp.sin(psi) * sp.cos(theta), -sp.sin(theta), sp.cos(psi) * sp.cos(theta)])
u0 = d.diff(theta)
l0 = u0.cross(d)
up = sp.cos(phi) * u0 + sp.sin(phi) * l0
left = up.cross(d)
assert sp.simplify(sp.Matrix.hstack(d, left, up).det()) == 1
assert sp.simplify(l0.dot(d.diff(psi)) + sp.cos(theta)) == 0 and sp.simplify(u0.dot(d.diff(theta))) == 1
assert [v.subs({psi: 0, theta: 0, phi: 0}) for v in (*d, *left, *up)] == [0, 0, 1, -1, 0, 0, 0, -1, 0]
# A small yaw to the left moves the direction of travel to the right of the image, pitch down moves it up, roll to the right side leans up to the left.
assert d.diff(psi).subs({psi: 0, theta: 0})[0] == 1 and d.diff(theta).subs({psi: 0, theta: 0})[1] == -1
assert up.diff(phi).subs({psi: 0, theta: 0, phi: 0})[0] == -1


def skew(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exp_so3(w):
    k, total, term = skew(w), eye(3), eye(3)
    for n in range(1, 60):
        term = term * k / n
        total = total + term
    return total


# (3): along an arc of radius rho about a vertical axis (camera y is down, so that a curve to the left is a rotation about -y) the half-way direction
# is the optical axis, which points along the road, for every angle.
for angle in (mpf("0.05"), mpf("0.4")):
    rho = 20
    at = lambda a: matrix([-rho * (1 - cos(a)), 0, rho * sin(a)])  # to the left is -x
    world_from = lambda a: exp_so3(matrix([0, -a, 0]))
    second_from_first = world_from(angle).T * world_from(0)
    t = world_from(angle).T * (at(0) - at(angle))
    t = t / sqrt(sum(v * v for v in t))
    r = matrix([0, angle, 0])
    assert max(abs(v) for v in exp_so3(r) - second_from_first) < TINY
    direction = -(exp_so3(-r / 2) * t)
    assert max(abs(v) for v in direction - matrix([0, 0, 1])) < TINY, direction

# (4): derivative by a left rotation of R, to first order in rho itself.
t = matrix([mpf("0.1"), mpf("-0.2"), mpf("-0.97")])
r = matrix([mpf("1e-9"), mpf("2e-9"), mpf("-1e-9")])
for i in range(3):
    axis = matrix([1 if j == i else 0 for j in range(3)])
    for row in range(3):
        numeric = diff(lambda h: -(exp_so3(-(r + h * axis) / 2) * t)[row], 0)
        dd = -(exp_so3(-r / 2) * t)
        assert abs(numeric - (skew(dd) * axis)[row] / 2) < mpf("1e-8"), (i, row)

# (9).
w, v, xc, yc = sp.symbols("w v x_c y_c", positive=True)
beta = sp.atan(w * xc / (v - w * yc))
assert sp.simplify(beta.diff(w).subs(w, 0) - xc / v) == 0

# (10), (11): points on a road below a camera that has a roll.
roll, height = mpf("0.1"), mpf("1.4")
u, l, f = matrix([0, -1, 0]), matrix([-1, 0, 0]), matrix([0, 0, 1])
n = cos(roll) * u + sin(roll) * l
alpha, b = cos(roll) / height, sin(roll) / height
m = -(alpha * u + b * l)
dot = lambda p, q: sum(x * y for x, y in zip(p, q))
for _ in range(5):
    y = matrix([random.uniform(-1, 1), random.uniform(0.3, 1), 1])
    y = y / sqrt(dot(y, y))
    depth = -height / dot(n, y)
    assert abs(1 / depth - dot(m, y)) < TINY
assert abs(1 / sqrt(alpha**2 + b**2) - height) < TINY and abs(mp.atan2(b, alpha) - roll) < TINY

# (13): vehicle that leans to the right (outwards) by lam in a curve to the left; the axis of the rotation is the true vertical. To first order.
lam, heading = sp.symbols("lambda Omega")
# Vertical in body axes (forward, left, up) after the body has rotated about forward by lam to its right side.
vertical = sp.Matrix([0, sp.sin(lam), sp.cos(lam)])
# ... and in camera axes without yaw and pitch: up and left coordinates of the camera (u0, l0) for a camera rolled by phi against the body.
up_in_cam = (sp.cos(phi), sp.sin(phi))
left_in_cam = (-sp.sin(phi), sp.cos(phi))
axis = [vertical[2] * up_in_cam[k] + vertical[1] * left_in_cam[k] for k in (0, 1)]
assert sp.simplify(axis[0] - sp.cos(phi + lam)) == 0 and sp.simplify(axis[1] - sp.sin(phi + lam)) == 0

# (7): blocks whose errors are correlated with the next one alone: the variance of the sum is n C0 + 2 (n - 1) C1, and (7)'s expectation is that.
n_blocks = 12
c0, c1 = sp.symbols("C0 C1")
total = sum(c0 if i == j else c1 if abs(i - j) == 1 else 0 for i in range(n_blocks) for j in range(n_blocks))
assert sp.expand(total - (n_blocks * c0 + 2 * (n_blocks - 1) * c1)) == 0

# (17): for a translation alone, the essential matrix through another lens is that of another translation, which has the same pixel.
fx, fy, cx, cy, gx, gy, hx, hy = sp.symbols("f_x f_y c_x c_y g_x g_y h_x h_y", positive=True)
true, stated = (sp.Matrix([[a, 0, c], [0, b, e], [0, 0, 1]]) for a, b, c, e in ((fx, fy, cx, cy), (gx, gy, hx, hy)))
t = sp.Matrix(sp.symbols("t_1:4"))
cross = lambda v: sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
by = true.inv() * stated
assert sp.simplify(by.T * cross(t) * by - by.det() * cross(by.inv() * t)) == sp.zeros(3)
assert sp.simplify(stated * by.inv() * t - true * t) == sp.zeros(3, 1)
# ... and the derivatives of the yaw of a pixel u.
u = sp.symbols("u", real=True)
yaw = sp.atan((u - cx) / fx)
assert sp.simplify(yaw.diff(cx) + sp.cos(yaw) ** 2 / fx) == 0
assert sp.simplify(yaw.diff(fx) + sp.sin(yaw) * sp.cos(yaw) / fx) == 0

# (18) of a linear function is its covariance, whatever the columns.
root, linear = sp.Matrix(2, 2, sp.symbols("l_1:5")), sp.Matrix(1, 2, sp.symbols("j_1:3"))
columns = [linear * root[:, k] for k in range(2)]
assert sp.expand(sum((c * c.T for c in columns), sp.zeros(1)) - linear * root * root.T * linear.T) == sp.zeros(1)
print("vehicle.md: all equations hold")
