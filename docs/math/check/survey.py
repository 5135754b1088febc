"""Checks docs/math/survey.md: eqs. (2)-(7), (9)-(12), (15)-(24) at random points to 40 digits. Needs mpmath."""

import random

import mpmath as mp

mp.mp.dps = 40
random.seed(8)
H = mp.mpf("1e-15")
TIGHT = mp.mpf("1e-18")


def rand(rows, cols=1, size=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)) * size)


def dot(a, b):
    return (a.T * b)[0]


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def unit(a):
    return a / mp.norm(a)


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def derivative(f, n):
    columns = []
    for i in range(n):
        step = mp.zeros(n, 1)
        step[i] = H
        up, down = f(step), f(-step)
        columns.append((up - down) / (2 * H))
    if not isinstance(columns[0], mp.matrix):
        columns = [mp.matrix([c]) for c in columns]
    return mp.matrix([[c[r] for c in columns] for r in range(len(columns[0]))])


def rotation():
    return mp.expm(hat(rand(3)), method="taylor")


def frame(n):
    first = unit(cross(n, rand(3)))
    return first, cross(n, first)


# (2): pixel by motion and point.
r, t, place = rotation(), mp.matrix([0, 0, 6]), rand(3, size=mp.mpf("0.5"))


def pixel(x):
    return mp.matrix([900 * x[0] / x[2], 910 * x[1] / x[2]])


x = r * place + t
j = derivative(lambda d: pixel(x + d), 3)
by_motion = derivative(lambda m: pixel(x + cross(m[:3], x) + m[3:]), 6)
by_place = derivative(lambda d: pixel(r * (place + d) + t), 3)
assert mp.norm(by_motion[:, :3] - j * -hat(x)) < TIGHT and mp.norm(by_motion[:, 3:] - j) < TIGHT
assert mp.norm(by_place - j * r) < TIGHT

# (3): L from the eigenvectors of the correlation gives the covariance back.
root = rand(4, 4)
cov = root * root.T
scale = [1, mp.mpf("1e3"), mp.mpf("1e-4"), 7]
cov = mp.matrix(4, 4).apply(lambda v: v) + mp.matrix([[cov[i, k] * scale[i] * scale[k] for k in range(4)] for i in range(4)])
sigma = [mp.sqrt(cov[i, i]) for i in range(4)]
values, vectors = mp.eigsy(mp.matrix([[cov[i, k] / sigma[i] / sigma[k] for k in range(4)] for i in range(4)]))
factor = mp.matrix([[sigma[i] * vectors[i, k] * mp.sqrt(values[k]) for k in range(4)] for i in range(4)])
assert mp.norm(factor * factor.T - cov) < mp.mpf("1e-25") * mp.norm(cov)

# (4), (5)
a, b = rand(3), rand(3)
e = unit(a - b)
assert mp.norm(derivative(lambda d: mp.norm(a + d - b), 3) - e.T) < TIGHT
assert mp.norm(derivative(lambda d: mp.norm(a - b - d), 3) + e.T) < TIGHT
n, p, h = unit(rand(3)), rand(3), mp.mpf("0.3")
b1, b2 = frame(n)


def tilted(s):
    return unit(n + b1 * s[0] + b2 * s[1])


above = derivative(lambda s: dot(tilted(s), a - p) - h, 2)
assert abs(above[0] - dot(b1, a - p)) < TIGHT and abs(above[1] - dot(b2, a - p)) < TIGHT

# (6): lean by the top; by the tilts the lean vector (d across n) changes by -(n.d) along each tangent.
foot, top = rand(3), rand(3)
length = mp.norm(top - foot)
d = unit(top - foot)
by_top = derivative(lambda s: dot(b1, unit(top + s - foot)), 3)
assert mp.norm(by_top - ((b1 - d * dot(d, b1)) / length).T) < TIGHT


def lean2(s):
    m = tilted(s)
    return 1 - dot(m, d) ** 2


by_tilt = derivative(lean2, 2)
for k, bk in enumerate((b1, b2)):
    assert abs(by_tilt[k] - 2 * dot(bk, d) * -dot(n, d)) < TIGHT

# (7): a tilt moves the predicted direction -R n as a turn by (-R n) x (-R b) does.
down = -(r * n)
for bk in (b1, b2):
    moved = -(r * bk)
    assert mp.norm(cross(cross(down, moved), down) - moved) < TIGHT

# (9), (10)
a, u = rand(3), unit(rand(3))
v = unit(cross(u, rand(3)))
w = cross(u, v)
ell, s, tt = mp.mpf("2.3"), mp.mpf("0.7"), mp.mpf("1.9")
b, c = a + u * ell, a + u * s + v * tt
target = a + u * mp.mpf("0.4") + v * mp.mpf("1.1")
ra, rb = mp.norm(target - a), mp.norm(target - b)
along = (ra**2 - rb**2 + ell**2) / (2 * ell)
assert mp.norm(a + u * along + v * mp.sqrt(ra**2 - along**2) - target) < TIGHT
target = target + w * mp.mpf("0.8")
ra, rb, rc = mp.norm(target - a), mp.norm(target - b), mp.norm(target - c)
along = (ra**2 - rb**2 + ell**2) / (2 * ell)
aside = (ra**2 - rc**2 + s**2 + tt**2 - 2 * s * along) / (2 * tt)
assert mp.norm(a + u * along + v * aside + w * mp.sqrt(ra**2 - along**2 - aside**2) - target) < TIGHT

# (11): moving everything leaves the point in the camera, and its distance from the plane, where they were, to first order.
xi = rand(6)
omega, nu = xi[:3], xi[3:]
adjoint_xi_turn = r * omega
adjoint_xi_shift = cross(t, r * omega) + r * nu


def in_camera(eps):
    moved = place + (cross(omega, place) + nu) * eps
    y = r * moved + t
    return y - (cross(adjoint_xi_turn, y) + adjoint_xi_shift) * eps


assert mp.norm(derivative(lambda eps: in_camera(eps[0]), 1)) < mp.mpf("1e-13")
on_it = p + n * h


def over_plane(eps):
    moved = place + (cross(omega, place) + nu) * eps
    m = unit(n + (b1 * dot(b1, cross(omega, n)) + b2 * dot(b2, cross(omega, n))) * eps)
    return dot(m, moved - p) - (h + dot(n, cross(omega, on_it) + nu) * eps)


assert abs(derivative(lambda eps: over_plane(eps[0]), 1)[0]) < mp.mpf("1e-13")

# (12): the step solves the Lagrange condition of a quadratic on a level plane.
root = rand(5, 5)
hess, grad, level = root * root.T, rand(5), rand(5)
wanted = mp.mpf("0.7")
y, z = hess**-1 * grad, hess**-1 * level
delta = y + z * ((wanted - dot(level, y)) / dot(level, z))
assert abs(dot(level, delta) - wanted) < TIGHT
rest = hess * delta - grad
assert mp.norm(rest - level * (dot(rest, level) / dot(level, level))) < TIGHT

# (15): covariance of the residual of one fact among independent whitened ones.
jac = rand(12, 4)
projector = mp.eye(12) - jac * (jac.T * jac) ** -1 * jac.T
block = projector[2:4, :] * projector[2:4, :].T
assert mp.norm(block - (mp.eye(2) - jac[2:4, :] * (jac.T * jac) ** -1 * jac[2:4, :].T)) < TIGHT

# (16), (17)
pa, pv, pb = rand(3), rand(3), rand(3)


def angle(a, v, b):
    p, q = unit(a - v), unit(b - v)
    return mp.acos(dot(p, q))


u, v = unit(pa - pv), unit(pb - pv)
by_a = -unit(v - u * dot(u, v)) / mp.norm(pa - pv)
by_b = -unit(u - v * dot(u, v)) / mp.norm(pb - pv)
assert mp.norm(derivative(lambda s: angle(pa + s, pv, pb), 3) - by_a.T) < TIGHT
assert mp.norm(derivative(lambda s: angle(pa, pv + s, pb), 3) + (by_a + by_b).T) < TIGHT
corners = [rand(3) for _ in range(5)]


def area(points):
    total = mp.zeros(3, 1)
    for i in range(5):
        total += cross(points[i], points[(i + 1) % 5])
    return total


normal = unit(area(corners))
for i in range(5):
    numeric = derivative(lambda s: mp.norm(area([c + s if k == i else c for k, c in enumerate(corners)])) / 2, 3)
    assert mp.norm(numeric - (cross(corners[(i + 1) % 5] - corners[i - 1], normal) / 2).T) < TIGHT

# (18): the place of a click on a plane by click, motion, tilt and height, against its own implicit derivative.
x = r * place + t
h = dot(n, place - p)


def place_of(step):
    click, motion, tilt, rise = step[:2], step[2:8], step[8:10], step[10]
    m = tilted(tilt)
    y = place.copy()
    for _ in range(6):
        z = r * y + t
        z = z + cross(motion[:3], z) + motion[3:]
        miss = mp.matrix([*(pixel(x) + click - pixel(z)), h + rise - dot(m, y - p)])
        by = j * r
        y = y + mp.matrix([[by[0, k] for k in range(3)], [by[1, k] for k in range(3)], [n[k] for k in range(3)]]) ** -1 * miss
    return y


numeric = derivative(place_of, 11)
by = j * r
m_inverse = mp.matrix([[by[0, k] for k in range(3)], [by[1, k] for k in range(3)], [n[k] for k in range(3)]]) ** -1
b_matrix = mp.zeros(3, 11)
b_matrix[0, 0] = b_matrix[1, 1] = 1
turn = j * -hat(x)
for row in range(2):
    for k in range(3):
        b_matrix[row, 2 + k], b_matrix[row, 5 + k] = -turn[row, k], -j[row, k]
b_matrix[2, 8], b_matrix[2, 9], b_matrix[2, 10] = -dot(b1, place - p), -dot(b2, place - p), 1
assert mp.norm(numeric - m_inverse * b_matrix) < mp.mpf("1e-9") * mp.norm(numeric)

# (19)-(22): a length between two points of a plane, seen by one camera.
nu = mp.matrix([mp.mpf("0.03"), mp.mpf("0.6"), mp.mpf("0.15")])
rays = [unit(mp.matrix([mp.mpf("-0.4"), mp.mpf("0.3"), 1])), unit(mp.matrix([mp.mpf("0.2"), mp.mpf("0.2"), 1]))]
on_plane = [ray / dot(nu, ray) for ray in rays]
assert all(abs(dot(nu, q) - 1) < TIGHT for q in on_plane)
m = cross(*rays)
assert mp.norm(on_plane[0] - on_plane[1] - cross(nu, m) / (dot(nu, rays[0]) * dot(nu, rays[1]))) < TIGHT
assert mp.norm(rays[0] * dot(nu, rays[1]) - rays[1] * dot(nu, rays[0]) - cross(nu, m)) < TIGHT


def log_length(v):
    return mp.log(mp.norm(cross(v, m))) - mp.log(dot(v, rays[0])) - mp.log(dot(v, rays[1]))


by_nu = (nu * dot(m, m) - m * dot(m, nu)) / mp.norm(cross(nu, m)) ** 2
by_nu -= rays[0] / dot(nu, rays[0]) + rays[1] / dot(nu, rays[1])
assert mp.norm(derivative(lambda d: log_length(nu + d), 3) - by_nu.T) < TIGHT
assert abs(log_length(3 * nu) - log_length(nu) + mp.log(3)) < TIGHT

# (23): what the rest foresees of a fact is tested as (15) tests it within the whole, where everything is linear.
rows, seen = rand(9, 4), rand(9)
kept, mine = rows[:7, :], rows[7:, :]
cov_all, cov_rest = (rows.T * rows) ** -1, (kept.T * kept) ** -1
left_all = seen - rows * (cov_all * (rows.T * seen))
left = seen[7:] - mine * (cov_rest * (kept.T * seen[:7]))
within = left_all[7:]
by_whole = dot(within, (mp.eye(2) - mine * cov_all * mine.T) ** -1 * within)
by_rest = dot(left, (mp.eye(2) + mine * cov_rest * mine.T) ** -1 * left)
assert abs(by_whole - by_rest) < TIGHT * by_rest
assert mp.norm((mp.eye(2) - mine * cov_all * mine.T) ** -1 * within - left) < TIGHT * mp.norm(left)

# (24): the height over the longest side is twice the area over that side.
a, b, c = rand(3), rand(3), rand(3)
along = unit(b - a)
height = mp.norm(cross(c - a, along))
assert abs(height - mp.norm(cross(b - a, c - a)) / mp.norm(b - a)) < TIGHT

print("survey.md: all equations hold")
