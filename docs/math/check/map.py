"""Checks docs/math/map.md: eqs. (1), (4)-(10) at random points to 40 digits. Needs mpmath."""

import random

import mpmath as mp

mp.mp.dps = 40
random.seed(7)


def matrix(rows, cols, size=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, size)))


def covariance(n, size=1):
    a = matrix(n, n, size)
    return a * a.T + mp.eye(n) * mp.mpf(size) ** 2 / 100


def near(a, b, tolerance=mp.mpf(10) ** -25):
    size = mp.norm(a - b, mp.inf) if isinstance(a - b, mp.matrix) else abs(a - b)
    assert size < tolerance, mp.nstr(size, 5)


def hat(v):
    return mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def put(into, row, column, block):
    for i in range(block.rows):
        for k in range(block.cols):
            into[row + i, column + k] = block[i, k]


def part(of, row, column, n=6, m=6):
    return mp.matrix([[of[row + i, column + k] for k in range(m)] for i in range(n)])


def twist(x):
    m = mp.zeros(4)
    put(m, 0, 0, hat(x[:3]))
    for i in range(3):
        m[i, 3] = x[3 + i]
    return m


def exp(x):
    return mp.expm(twist(x), method="taylor")


def log(pose):
    m = mp.logm(pose)
    return mp.matrix([m[2, 1], m[0, 2], m[1, 0], m[0, 3], m[1, 3], m[2, 3]]).apply(mp.re)


def adjoint(pose):
    r, t = part(pose, 0, 0, 3, 3), mp.matrix([pose[i, 3] for i in range(3)])
    ad = mp.zeros(6)
    put(ad, 0, 0, r)
    put(ad, 3, 3, r)
    put(ad, 3, 0, hat(t) * r)
    return ad


small = mp.mpf(10) ** -12

# (1): two estimates Exp(-alpha_p) A, Exp(-alpha_q) A of one pose differ by alpha_q - alpha_p, to second order.
a, alpha_p, alpha_q = exp(matrix(6, 1)), matrix(6, 1) * small, matrix(6, 1) * small
delta = log(exp(-alpha_p) * a * (exp(-alpha_q) * a) ** -1)
near(delta / small, (alpha_q - alpha_p) / small, 100 * small)

# (4): true poses Exp(eps) p = Exp(w) W Exp(alpha) a.
w, alpha, eps = matrix(6, 1) * small, matrix(6, 1) * small, matrix(6, 1) * small
world, a = exp(matrix(6, 1)), exp(matrix(6, 1))
p = exp(-eps) * exp(w) * world * exp(alpha) * a
d = log(p * (world * a) ** -1)
near(d / small, (w + adjoint(world) * alpha - eps) / small, 1000 * small)

# (5) against one least-squares problem over w and the motions of three targets of the map and as known, with priors Sigma and P and the condition that
# both poses of a target agree, made soft with a variance that vanishes.
n = 3
sigma, prior = covariance(6 * n), covariance(6 * n)  # Sigma in the world's axes: Ad is in it.
d = matrix(6 * n, 1)
unknowns = 6 * (1 + 2 * n)
mp.mp.dps = 120  # The vanishing variance takes 36 digits.
soft = mp.mpf(10) ** -36
h, g = mp.zeros(unknowns), mp.zeros(unknowns, 1)
put(h, 6, 6, sigma ** -1)
put(h, 6 + 6 * n, 6 + 6 * n, prior ** -1)
for k in range(n):
    row = mp.zeros(6, unknowns)
    put(row, 0, 0, mp.eye(6))
    put(row, 0, 6 + 6 * k, mp.eye(6))
    put(row, 0, 6 + 6 * n + 6 * k, -mp.eye(6))
    h += row.T * row / soft
    g += row.T * part(d, 6 * k, 0, 6, 1) / soft
whole, x = h ** -1, mp.lu_solve(h, g)
mp.mp.dps = 40
c, e = sigma + prior, mp.zeros(6 * n, 6)
for k in range(n):
    put(e, 6 * k, 0, mp.eye(6))
m = (e.T * c ** -1 * e) ** -1
near(m * e.T * c ** -1 * d, part(x, 0, 0, 6, 1), mp.mpf(10) ** -20)
near(m, part(whole, 0, 0), mp.mpf(10) ** -20)

# (6): leaving one of four known targets out lowers chi^2 by T.
n = 4
c, e, d = covariance(6 * n), mp.zeros(6 * n, 6), matrix(6 * n, 1)
for k in range(n):
    put(e, 6 * k, 0, mp.eye(6))


def chi2(c, e, d):
    ci = c ** -1
    r = d - e * ((e.T * ci * e) ** -1 * e.T * ci * d)
    return (r.T * ci * r)[0]


ci = c ** -1
m = (e.T * ci * e) ** -1
r = d - e * (m * e.T * ci * d)
q, u = ci - ci * e * m * e.T * ci, ci * r
last = 6 * (n - 1)
t = (part(u, last, 0, 6, 1).T * part(q, last, last) ** -1 * part(u, last, 0, 6, 1))[0]
near(chi2(c, e, d) - t, chi2(part(c, 0, 0, last, last), part(e, 0, 0, last, 6), part(d, 0, 0, last, 1)))

# (7): a map grown by s moves world_from_target = W a by Ad [0; t] s.
s = small
a, world = exp(matrix(6, 1)), exp(matrix(6, 1))
grown = a.copy()
for i in range(3):
    grown[i, 3] *= 1 + s
motion = log(world * grown * (world * a) ** -1)
expected = adjoint(world) * mp.matrix([0, 0, 0, a[0, 3], a[1, 3], a[2, 3]])
near(motion / s, expected, 1000 * s)

# (8): with the frame of a target as the world, e of that target vanishes whatever the common motion; the errors of the others follow.
common, unknown = exp(matrix(6, 1)), exp(matrix(6, 1))
eta = log(unknown * (common * unknown) ** -1)
near(eta + log(common), mp.zeros(6, 1))
eta = matrix(6, 1) * mp.mpf("0.1")
near(log(exp(eta) * common * unknown * (common * unknown) ** -1), eta)

# (9): Lambda is the information with the common motion unknown, the limit of a common motion of any size; it costs nothing.
n, mp.mp.dps = 3, 80
sigma, e = covariance(6 * n), mp.zeros(6 * n, 6)
for k in range(n):
    put(e, 6 * k, 0, mp.eye(6))
inverse = sigma ** -1
information = inverse - inverse * e * (e.T * inverse * e) ** -1 * e.T * inverse
near(information * e, mp.zeros(6 * n, 6), mp.mpf(10) ** -40)
near((sigma + mp.mpf(10) ** 40 * e * e.T) ** -1, information, mp.mpf(10) ** -30)
mp.mp.dps = 40

# (10): a small motion of the unknown pose, about a common motion of any size.
eta, x = matrix(6, 1) * small, matrix(6, 1) * small
p = exp(eta) * common * unknown
changed = log(p * (common * exp(x) * unknown) ** -1)
near((changed - eta) / small, -adjoint(common) * x / small, 1000 * small)
print("map.md: ok")
