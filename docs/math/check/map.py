"""Checks docs/math/map.md: eqs. (1), (4)-(9) at random points to 40 digits. Needs mpmath."""

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

# (5)-(7) against one least-squares problem over w, the motions of three targets of the map (the first two known) and of three known ones (the
# last not seen), with priors Sigma and P and the condition that both poses of a target agree, made soft with a variance that vanishes.
n_map, n_known, n_both = 3, 3, 2
sigma, prior = covariance(6 * n_map), covariance(6 * n_known)  # Sigma in the world's axes: Ad is in it.
d = matrix(6 * n_both, 1)
unknowns = 6 * (1 + n_map + n_known)
mp.mp.dps = 120  # The vanishing variance takes 36 digits.
soft = mp.mpf(10) ** -36
h, g = mp.zeros(unknowns), mp.zeros(unknowns, 1)
put(h, 6, 6, sigma ** -1)
put(h, 6 + 6 * n_map, 6 + 6 * n_map, prior ** -1)
for k in range(n_both):
    row = mp.zeros(6, unknowns)
    put(row, 0, 0, mp.eye(6))
    put(row, 0, 6 + 6 * k, mp.eye(6))
    put(row, 0, 6 + 6 * n_map + 6 * k, -mp.eye(6))
    h += row.T * row / soft
    g += row.T * part(d, 6 * k, 0, 6, 1) / soft
whole, x = h ** -1, mp.lu_solve(h, g)
mp.mp.dps = 40

c, e = mp.zeros(6 * n_both), mp.zeros(6 * n_both, 6)
for k in range(n_both):
    put(e, 6 * k, 0, mp.eye(6))
    for l in range(n_both):
        put(c, 6 * k, 6 * l, part(sigma, 6 * k, 6 * l) + part(prior, 6 * k, 6 * l))
ci = c ** -1
m = (e.T * ci * e) ** -1
w_hat = m * e.T * ci * d
r = d - e * w_hat
near(w_hat, part(x, 0, 0, 6, 1), mp.mpf(10) ** -20)

n_all = n_map + 1  # And the known target that is not seen.
z, cross, by = mp.zeros(6 * n_all), mp.zeros(6 * n_all, 6 * n_both), mp.zeros(6 * n_all, 6)
put(z, 0, 0, sigma)
put(z, 6 * n_map, 6 * n_map, part(prior, 12, 12))
for k in range(n_both):
    for t in range(n_map):
        put(cross, 6 * t, 6 * k, part(sigma, 6 * t, 6 * k))
    put(cross, 6 * n_map, 6 * k, -part(prior, 12, 6 * k))
for t in range(n_map):
    put(by, 6 * t, 0, mp.eye(6))
moved = by * w_hat + cross * ci * r
left = by - cross * ci * e
posterior = z - cross * ci * cross.T + left * m * left.T
take = mp.zeros(6 * n_all, unknowns)
for t in range(n_map):
    put(take, 6 * t, 0, mp.eye(6))
    put(take, 6 * t, 6 + 6 * t, mp.eye(6))
put(take, 6 * n_map, 6 + 6 * n_map + 12, mp.eye(6))
near(moved, take * x, mp.mpf(10) ** -20)
near(posterior, take * whole * take.T, mp.mpf(10) ** -20)

# (8): leaving one of four known targets out lowers chi^2 by T.
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

# (9): a map grown by s moves world_from_target = W a by Ad [0; t] s.
s = small
a, world = exp(matrix(6, 1)), exp(matrix(6, 1))
grown = a.copy()
for i in range(3):
    grown[i, 3] *= 1 + s
motion = log(world * grown * (world * a) ** -1)
expected = adjoint(world) * mp.matrix([0, 0, 0, a[0, 3], a[1, 3], a[2, 3]])
near(motion / s, expected, 1000 * s)
print("map.md: ok")
