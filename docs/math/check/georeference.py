"""Proves the equations of georeference.md: the frame of east, north and up, the angles and their signs, and the limit of a footprint.

Run: python3 docs/math/check/georeference.py
"""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(12)

# (2): the columns of E are the derivatives of (1) by longitude, latitude and height, made unit vectors.
phi, lam, h = sp.symbols("phi lambda h", real=True)
a, e2 = sp.symbols("a e2", positive=True)
N = a / sp.sqrt(1 - e2 * sp.sin(phi) ** 2)
X = sp.Matrix([(N + h) * sp.cos(phi) * sp.cos(lam), (N + h) * sp.cos(phi) * sp.sin(lam), (N * (1 - e2) + h) * sp.sin(phi)])
E = sp.Matrix([
    [-sp.sin(lam), -sp.sin(phi) * sp.cos(lam), sp.cos(phi) * sp.cos(lam)],
    [sp.cos(lam), -sp.sin(phi) * sp.sin(lam), sp.cos(phi) * sp.sin(lam)],
    [0, sp.cos(phi), sp.sin(phi)],
])
assert sp.simplify(E.T * E - sp.eye(3)) == sp.zeros(3) and sp.simplify(E.det()) == 1
values = {a: 6378137, e2: sp.Rational(669437999014, 10**14), phi: sp.Rational(9, 10), lam: sp.Rational(23, 100), h: 70}
for column, by in enumerate([lam, phi, h]):
    derivative = X.diff(by).subs(values).evalf(40)
    direction = derivative / derivative.norm()
    assert (direction - E[:, column].subs(values).evalf(40)).norm() < 1e-30, by


def rotation(axis, angle):
    x, y, z = axis
    k = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mp.eye(3) + mp.sin(angle) * k + (1 - mp.cos(angle)) * k * k


def cam_from_enu(heading, tilt, roll):
    """Built by turning a camera: level and to the north, then by the heading about down, by the tilt about its right, by the roll about its axis."""
    level_north = mp.matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # rows: right = east, down, axis = north
    turned = level_north * rotation((0, 0, 1), heading)  # enu rows rotate by the heading clockwise from north
    tilted = rotation((1, 0, 0), tilt) * turned  # in camera axes the scene moves up: a positive turn about x
    return rotation((0, 0, 1), -roll) * tilted


def angles(c):
    r, d, x = ([c[i, j] for j in range(3)] for i in range(3))
    return mp.atan2(x[0], x[1]), mp.atan2(-x[2], mp.hypot(x[0], x[1])), mp.atan2(-r[2], -d[2]), mp.atan2(-d[0], -d[1])


for _ in range(50):
    heading, tilt, roll = (mp.mpf(random.uniform(-s, s)) for s in (3.1, 1.5, 3.1))
    found = angles(cam_from_enu(heading, tilt, roll))
    for x, y in zip(found, (heading, tilt, roll)):
        assert abs(x - y) < mp.mpf(10) ** -30, (found, heading, tilt, roll)
# (7) rolled clockwise as seen from behind, the right side is lower; (6) a positive tilt looks down.
c = cam_from_enu(mp.mpf("0.3"), mp.mpf("0.2"), mp.mpf("0.1"))
assert c[0, 2] < 0 and c[2, 2] < 0
# (8) straight down with the top to the east.
down = cam_from_enu(mp.pi / 2, mp.pi / 2, 0)
assert abs(angles(down)[3] - mp.pi / 2) < 1e-30

# (10), (11): the distance of the ray's ground point, and the limit.
for _ in range(50):
    v = [mp.mpf(random.uniform(-1, 1)), mp.mpf(random.uniform(-1, 1)), mp.mpf(random.uniform(-1, -0.01))]
    H, L = mp.mpf(random.uniform(1, 100)), mp.mpf(random.uniform(1, 1000))
    x = [v[i] * H / -v[2] for i in range(3)]
    assert abs(x[2] + H) < 1e-30
    assert (mp.hypot(x[0], x[1]) <= L) == (H * mp.hypot(v[0], v[1]) <= -L * v[2])
print("georeference.md: frames, angles with their signs, and the limit of a footprint hold")
