"""Checks docs/math/clustered.md: eqs. (1)-(5) at random points to 40 digits, (7), (9), (11) by quadrature or exact moments. Needs mpmath, SymPy."""

import random

import mpmath as mp
import sympy

mp.mp.dps = 40
random.seed(8)


def matrix(rows, cols):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)))


def close(a, b, tolerance="1e-25"):
    assert mp.norm(a - b) < mp.mpf(tolerance) * (1 + mp.norm(b)), mp.norm(a - b)


# A linear rig: shared unknowns, own unknowns of each view, rows of each view.
shared, own, views = 4, 3, 6
rows = [matrix(9 + v, shared + own) for v in range(views)]
seen = [matrix(9 + v, 1) for v in range(views)]


def solve(kept):
    """The whole problem of the kept views; shared unknowns and their inverse information."""
    n = shared + own * len(kept)
    h, g = mp.zeros(n), mp.zeros(n, 1)
    for i, v in enumerate(kept):
        wide = mp.zeros(rows[v].rows, n)
        wide[:, :shared] = rows[v][:, :shared]
        for j in range(own):
            wide[:, shared + own * i + j] = rows[v][:, shared + j]
        h += wide.T * wide
        g += wide.T * seen[v]
    inverse = h**-1
    return inverse * g, inverse[:shared, :shared]


everything, p = solve(list(range(views)))
eta = everything[:shared, 0]
informations, scores = [], []
for v in range(views):
    j, k = rows[v][:, :shared], rows[v][:, shared:]
    left = seen[v] - j * eta
    inner = (k.T * k) ** -1
    informations.append(j.T * j - j.T * k * inner * k.T * j)
    scores.append(j.T * left - j.T * k * inner * k.T * left)
total = sum(scores, mp.zeros(shared, 1))
close(total, mp.zeros(shared, 1))
close(sum(informations, mp.zeros(shared)), p**-1)

# (1): from another place, the scores move by - S_v times the step.
off = matrix(shared, 1)
for v in range(views):
    j, k = rows[v][:, :shared], rows[v][:, shared:]
    left = seen[v] - j * (eta - off)
    score = j.T * left - j.T * k * ((k.T * k) ** -1) * k.T * left
    close(score - informations[v] * off, scores[v])

# (3): leaving a view out, against the problem without it.
one = mp.eye(shared)
for v in range(views):
    without, _ = solve([w for w in range(views) if w != v])
    pull = (one - informations[v] * p) ** -1 * scores[v]
    close(without[:shared, 0] - eta, -p * pull)

# E[s sT] at the minimum, and (4): the mean of CR3 where the stated covariance holds. Residual maker: s_v = e_v - S_v P sum e_w, Cov e_w = S_w.
expected = nominal = mp.mpf(0)
for v in range(views):
    s = informations[v]
    variance = mp.zeros(shared)
    for w in range(views):
        by = (one if v == w else mp.zeros(shared)) - s * p
        variance += by * informations[w] * by.T
    close(variance, s - s * p * s)
    b = s * p
    whitened = p * (one - b) ** -1 * variance * ((one - b) ** -1).T
    trace = lambda m: sum(m[i, i] for i in range(m.rows))
    expected += trace(whitened)
    nominal += trace(b)
    # The sums as they are taken, from the inverse with a ridge.
    ridge = mp.mpf("1e-6")
    inverse = ((1 + ridge) * one - b) ** -1
    seen_sum = (1 + ridge) * trace(inverse) - shared
    close(mp.matrix([seen_sum]), mp.matrix([trace(b * inverse)]))
    close(
        mp.matrix([seen_sum - ridge * ((1 + ridge) * trace(inverse * inverse) - trace(inverse))]),
        mp.matrix([trace(b * (one - b) * inverse * inverse)]),
    )
direct = sum((lambda b: sum((b * (one - b) ** -1)[i, i] for i in range(shared)))(informations[v] * p) for v in range(views))
assert abs(direct - expected) < mp.mpf("1e-25") * expected
assert abs(nominal - shared) < mp.mpf("1e-25")

# (8): where S_w is the variance of each view, E Q = sum of ranks less the shared unknowns.
mean_q = sum((informations[v] ** -1 * (informations[v] - informations[v] * p * informations[v]))[i, i] for v in range(views) for i in range(shared))
assert abs(mean_q - (views - 1) * shared) < mp.mpf("1e-25")

# (7): |y|^2 of p normal numbers has E = p, E of the square = p^2 + 2p; k equal clusters are worth k.
p_, k_ = sympy.symbols("p k", positive=True)
x = sympy.symbols("x", positive=True)
density = x ** (p_ / 2 - 1) * sympy.exp(-x / 2) / (2 ** (p_ / 2) * sympy.gamma(p_ / 2))
for dimension in (1, 2, 6):
    moments = [sympy.integrate(x**n * density.subs(p_, dimension), (x, 0, sympy.oo)) for n in (1, 2)]
    assert sympy.simplify(moments[0] - dimension) == 0
    assert sympy.simplify(moments[1] - (dimension**2 + 2 * dimension)) == 0
count = (1 + 2 / p_) * (k_ * p_) ** 2 / (k_ * (p_**2 + 2 * p_))
assert sympy.simplify(count - k_) == 0

# (9): W = (1/k) sum of k outer products of p standard normal numbers, m = tr W/p. E|W - m|^2 = E tr W^2 - E (tr W)^2/p.
square = p_ + (p_**2 + p_) / k_  # E tr W^2
trace_square = p_**2 + 2 * p_ / k_  # E (tr W)^2
assert sympy.simplify(square - trace_square / p_ - (p_**2 + p_ - 2) / k_) == 0
# Those two moments, for p = 2: from Isserlis, by enumeration of E[y_i y_j y_k y_l].
delta = lambda i, j: 1 if i == j else 0
for dimension in (2, 3, 6):
    r = range(dimension)
    fourth = lambda i, j, m, n: delta(i, j) * delta(m, n) + delta(i, m) * delta(j, n) + delta(i, n) * delta(j, m)
    same = sum(fourth(i, j, i, j) for i in r for j in r)  # one cluster with itself
    other = sum(delta(i, j) for i in r for j in r)
    assert sympy.simplify(square.subs(p_, dimension) - (same / k_ + other * (1 - 1 / k_))) == 0
    same = sum(fourth(i, i, j, j) for i in r for j in r)
    assert sympy.simplify(trace_square.subs(p_, dimension) - (same / k_ + dimension**2 * (1 - 1 / k_))) == 0

# (11): first terms of both inverse moments, the second from the density itself.
z = sympy.symbols("z", positive=True)
assert sympy.series((1 / z) / (1 / z - p_ - 1), z, 0, 2).removeO().equals(1 + (p_ + 1) * z)
for dof in (6, 10):
    mean = sympy.integrate(dof / x * density.subs(p_, dof), (x, 0, sympy.oo))
    assert sympy.simplify(mean - sympy.Rational(dof, dof - 2)) == 0
assert sympy.series((1 / z) / (1 / z - 2), z, 0, 2).removeO().equals(1 + 2 * z)

# (10): two blocks of one unknown that move together: D P D is below P for their difference, c P + D1 P D1 is not, and both have the same blocks.
p, d = sympy.Matrix([[1, sympy.Rational(999, 1000)], [sympy.Rational(999, 1000), 1]]), (sympy.Integer(1), sympy.Rational(3, 2))
root = sympy.diag(*(sympy.sqrt(x) for x in d))
alone = root * p * root
beyond = sympy.diag(*(sympy.sqrt(x - min(d)) for x in d))
added = min(d) * p + beyond * p * beyond
assert not (alone - p).is_positive_semidefinite and (added - p).is_positive_semidefinite
assert all(sympy.simplify(added[i, i] - alone[i, i]) == 0 and alone[i, i] == d[i] for i in (0, 1))
print("clustered.md: all equations hold")
