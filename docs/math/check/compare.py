"""Proves the equations of compare.md: what M_i is, its derivative, independence of base and frame, the conditional motion, the tail.

Run: python3 docs/math/check/compare.py
"""

import random

import mpmath as mp

mp.mp.dps = 50
random.seed(8)


def vector(n, scale=1.0):
    return mp.matrix([mp.mpf(random.uniform(-scale, scale)) for _ in range(n)])


def hat(w):
    return mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exp(xi):
    """Exp of [rotation; translation] as a 4x4 matrix, by its series."""
    x = mp.zeros(4)
    x[0:3, 0:3] = hat(xi[0:3])
    for i in range(3):
        x[i, 3] = xi[3 + i]
    total, term = mp.eye(4), mp.eye(4)
    for k in range(1, 120):
        term = term * x / k
        total += term
    return total


def log(m):
    """Log near the identity by Newton's method on exp."""
    xi = mp.zeros(6, 1)
    for _ in range(12):
        d = inverse(exp(xi)) * m - mp.eye(4)
        step = mp.matrix([d[2, 1], d[0, 2], d[1, 0], d[0, 3], d[1, 3], d[2, 3]])
        # exp(xi) exp(step): to first order the right Jacobian is the identity, so the steps shrink geometrically.
        xi = xi + step
        if mp.norm(step) < mp.mpf(10) ** -45:
            break
    return xi


def inverse(m):
    r = m[0:3, 0:3].T
    out = mp.eye(4)
    out[0:3, 0:3] = r
    t = -(r * m[0:3, 3])
    for i in range(3):
        out[i, 3] = t[i]
    return out


def adjoint(m):
    r, t = m[0:3, 0:3], m[0:3, 3]
    out = mp.zeros(6)
    out[0:3, 0:3] = r
    out[3:6, 3:6] = r
    out[3:6, 0:3] = hat(t) * r
    return out


def near(name, difference, limit):
    size = mp.norm(difference) if isinstance(difference, mp.matrix) else abs(difference)
    assert size < limit, (name, mp.nstr(size, 5))
    print("ok ", name, mp.nstr(size, 3))


def covariance(n, scale):
    a = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            a[i, j] = mp.mpf(random.uniform(-1, 1)) * scale + (2 * scale if i == j else 0)
    return a * a.T


# (2): with b at rest, M_i takes the new camera's coordinates to the old camera's.
a_i, a_b, motion = exp(vector(6)), exp(vector(6)), exp(vector(6, 0.3))
# Camera i moved by `motion` (old_from_new) in a world where b and the rig's frame stay; then the frame changes by G.
g = exp(vector(6))
b_i, b_b = inverse(motion) * a_i * g, a_b * g
m = (a_i * inverse(a_b)) * inverse(b_i * inverse(b_b))
near("(2) M_i is old_from_new, whatever the frame", m - motion, mp.mpf(10) ** -44)

# (3): derivative of e_i by finite differences of step h: the error is of the order of h times the motion.
small = mp.mpf(10) ** -12
b_i = inverse(exp(vector(6, 1e-9))) * a_i * g


def e_of(eta_i, eta_b, zeta_i, zeta_b):
    aib = exp(eta_i) * a_i * inverse(exp(eta_b) * a_b)
    bib = exp(zeta_i) * b_i * inverse(exp(zeta_b) * b_b)
    return log(aib * inverse(bib))


zero = mp.zeros(6, 1)
aib = a_i * inverse(a_b)
m = aib * inverse(b_i * inverse(b_b))
terms = [mp.eye(6), -adjoint(aib), -adjoint(m), adjoint(aib)]
base = e_of(zero, zero, zero, zero)
for k, term in enumerate(terms):
    direction = vector(6)
    arguments = [zero] * 4
    arguments[k] = direction * small
    near(f"(3) term {k}", (e_of(*arguments) - base) / small - term * direction, mp.mpf(10) ** -8)

# (5): χ² does not depend on the base (linear problem), nor χ²_m = χ²(S ∪ m) − χ²(S) on how it is split: (6).
n = 3
poses = [exp(vector(6)) for _ in range(n)]
sigma = covariance(6 * n, mp.mpf(10) ** -3)
true_noise = vector(6 * n, 1e-3)


def rows(i, b):
    """Of e_i seen from b, in the small motions of A (those of B enter likewise)."""
    out = mp.zeros(6, 6 * n)
    for k in range(6):
        out[k, 6 * i + k] += 1
    ad = adjoint(poses[i] * inverse(poses[b]))
    for r in range(6):
        for c in range(6):
            out[r, 6 * b + c] -= ad[r, c]
    return out


def stack(list_of):
    out = mp.zeros(6 * len(list_of), 6 * n)
    for k, block in enumerate(list_of):
        out[6 * k : 6 * k + 6, 0 : 6 * n] = block
    return out


def chi2(j):
    e = j * true_noise
    return (e.T * mp.lu_solve(j * sigma * j.T, e))[0]


whole = [chi2(stack([rows(i, b) for i in range(n) if i != b])) for b in range(n)]
near("(5) base 0 and base 1", whole[0] / whole[1] - 1, mp.mpf(10) ** -35)
near("(5) base 0 and base 2", whole[0] / whole[2] - 1, mp.mpf(10) ** -35)

j_s, j_m = rows(1, 0), rows(2, 0)
e_s, e_m = j_s * true_noise, j_m * true_noise
e_ss, e_ms, e_mm = j_s * sigma * j_s.T, j_m * sigma * j_s.T, j_m * sigma * j_m.T
delta = e_m - e_ms * mp.lu_solve(e_ss, e_s)
conditional = e_mm - e_ms * mp.inverse(e_ss) * e_ms.T
split = (delta.T * mp.lu_solve(conditional, delta))[0]
near("(6) χ²_m = χ²(S ∪ m) − χ²(S)", split / (whole[0] - chi2(j_s)) - 1, mp.mpf(10) ** -35)

# The bound of section 2: 2 (Σ_ii + Σ_jj) − cov(difference) = cov(sum) is positive semidefinite.
half = mp.zeros(6, 6 * n)
for k in range(6):
    half[k, k], half[k, 6 + k] = 1, 1
sum_covariance = half * sigma * half.T
assert all(value > 0 for value in mp.eigsy(sum_covariance, eigvals_only=True))
print("ok  correlations understate a difference by two at most")


# (8) and the table of chi_square.rs: the sum against the incomplete gamma function.
def tail(k, x):
    y = mp.mpf(x) / 2
    logarithm = mp.log(y) / 2 - y + mp.log(2 / mp.sqrt(mp.pi)) if k % 2 else -y
    a, total = (mp.mpf(1) / 2 if k % 2 else mp.mpf(0)), mp.mpf(0)
    for _ in range(k // 2):
        total += mp.exp(logarithm)
        a += 1
        logarithm += mp.log(y / a)
    return total


for k, x in ((1194, 1300), (1195, 1300), (6000, 6200), (1000, 1201), (999, 1199)):
    exact = mp.gammainc(mp.mpf(k) / 2, mp.mpf(x) / 2, regularized=True)
    near(f"(8) {k} degrees of freedom, χ² {x}: {mp.nstr(exact, 15)}", tail(k, x) / exact - 1, mp.mpf(10) ** -30)


# (9): for a random covariance of three cameras m·blockdiag − Σ is positive semidefinite, and wholly shared errors reach the bound.
def own_blocks(matrix):
    out = mp.zeros(matrix.rows)
    for i in range(0, matrix.rows, 6):
        out[i : i + 6, i : i + 6] = matrix[i : i + 6, i : i + 6]
    return out


def least_eigenvalue(matrix):
    return min(mp.eigsy((matrix + matrix.T) / 2, eigvals_only=True))


for trial in range(5):
    rank = random.choice([1, 3, 18])
    a = mp.matrix(18, rank)
    for i in range(18):
        for j in range(rank):
            a[i, j] = mp.mpf(random.gauss(0, 1))
    assert least_eigenvalue(3 * own_blocks(a * a.T) - a * a.T) > -mp.mpf(10) ** -40
print("ok  (9) m blockdiag(Σ) − Σ has no negative eigenvalue")
common = covariance(6, mp.mpf(1))
shared = mp.zeros(18)
for i in range(0, 18, 6):
    for j in range(0, 18, 6):
        shared[i : i + 6, j : j + 6] = common
same = mp.matrix([vector_i for _ in range(3) for vector_i in [1, -2, 3, 1, 0, 2]])
near("(9) equality for shared errors", (same.T * (3 * own_blocks(shared) - shared) * same)[0], mp.mpf(10) ** -40)
# With one camera fewer the bound would fail: m is needed.
assert (same.T * (2 * own_blocks(shared) - shared) * same)[0] < 0
# Hence χ² with the bound is no larger, of all and of what one camera adds (the Schur complement), for any e.
bound, e = 3 * own_blocks(sigma), vector(18)
quadratic = lambda m, e: (e.T * mp.lu_solve(m, e))[0]
assert quadratic(bound, e) <= quadratic(sigma, e)
k_bound = bound[12:18, 0:12] * mp.inverse(bound[0:12, 0:12])
difference_of = mp.zeros(6, 18)
difference_of[0:6, 0:12], difference_of[0:6, 12:18] = -k_bound, mp.eye(6)
v, r = difference_of * bound * difference_of.T, difference_of * e
near("(9) χ²(S) − χ²(S∖i) by the Schur complement", quadratic(v, r) / (quadratic(bound, e) - quadratic(bound[0:12, 0:12], e[0:12, 0])) - 1, mp.mpf(10) ** -35)
assert least_eigenvalue(v - difference_of * sigma * difference_of.T) > 0
print("ok  (9) no statistic is larger than with the true covariance")


# (10) against the incomplete beta function, and the table of variance_ratio.rs.
def tail_of_f(k, nu, q):
    term, total = mp.mpf(1), mp.mpf(0)
    for j in range(k // 2):
        total += term
        term *= (mp.mpf(nu) / 2 + j) / (j + 1) * q / (nu + mp.mpf(q))
    return (1 + q / mp.mpf(nu)) ** (-mp.mpf(nu) / 2) * total


for k, nu, q in ((6, 3, 20), (6, 3, 850), (12, 7.5, 60), (18, 21, 45), (6, 0.5, 10), (1200, 400, 2000)):
    exact = mp.betainc(mp.mpf(nu) / 2, mp.mpf(k) / 2, 0, nu / (nu + mp.mpf(q)), regularized=True)
    near(f"(10) F({k}, {nu}), χ² {q}: {mp.nstr(exact, 14)}", tail_of_f(k, nu, q) / exact - 1, mp.mpf(10) ** -30)
near("(10) many degrees are no noise", tail_of_f(18, mp.mpf(10) ** 15, 30) / tail(18, 30) - 1, mp.mpf(10) ** -12)

# (11): the mean of eᵀÊ⁻¹e by its second derivative in each factor, times half the variance 2/ν of that factor.
parts = [covariance(6, mp.mpf(1)), covariance(6, mp.mpf(1))]
total, step, nus = parts[0] + parts[1], mp.mpf(10) ** -12, [7, 12]
mean = mp.mpf(6)
for f in range(2):
    at = lambda x: sum((mp.inverse(total + parts[f] * x) * total)[i, i] for i in range(6))
    mean += (at(step) - 2 * at(0) + at(-step)) / step**2 / 2 * mp.mpf(2) / nus[f]
shares = [mp.inverse(total) * part for part in parts]
trace = lambda m: sum(m[i, i] for i in range(m.rows))
second = 6 + sum(2 * trace(share * share) / nu for share, nu in zip(shares, nus))
near("(11) mean to second order", mean - second, mp.mpf(10) ** -15)
degrees = 6 / sum(trace(share * share) / nu for share, nu in zip(shares, nus))
near("(11) as that of F", 6 * (1 + 2 / degrees) - second, mp.mpf(10) ** -40)
assert min(nus) <= degrees <= sum(nus)
half = [total / 2, total / 2]
near("(11) parts alike: the sum", 6 / sum(trace((mp.inverse(total) * part) ** 2) / nu for part, nu in zip(half, [7, 7])) - 14, mp.mpf(10) ** -40)
turn, shift_part = mp.diag([1, 2, 3, 0, 0, 0]), mp.diag([0, 0, 0, 2, 1, 1])
both = mp.inverse(total) * (turn + shift_part)
apart = [mp.inverse(total) * turn, mp.inverse(total) * shift_part]
assert trace(both * both) >= sum(trace(one * one) for one in apart)
print("ok  (11) turns and shifts as one part make ν no larger")
# (12): −2 ln of the density of the multivariate t with scale E, up to what does not depend on e; many degrees give χ².
near("(12) many degrees give χ²", (mp.mpf(10) ** 30 + 6) * mp.log1p(mp.mpf(20) / mp.mpf(10) ** 30) - 20, mp.mpf(10) ** -20)
