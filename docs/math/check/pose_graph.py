"""Checks docs/math/pose_graph.md: eqs. (2)-(4), (8)-(12) at 40 digits or against exact distributions. Needs mpmath and SymPy."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(3)


def matrix(rows, cols, scale=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)) * scale)


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def wedge(xi):
    m = mp.zeros(4)
    m[:3, :3] = hat(xi[:3])
    for i in range(3):
        m[i, 3] = xi[3 + i]
    return m


def exp(xi):
    return mp.expm(wedge(xi), method="taylor")


def log(m):
    """Inverse scaling and squaring, then the series of log(1 + x): shares nothing with the formulas under test."""
    halvings = 30
    for _ in range(halvings):
        m = mp.sqrtm(m)
    x, power, total = m - mp.eye(4), mp.eye(4), mp.zeros(4)
    for n in range(1, 12):
        power = power * x
        total += power * (mp.mpf((-1) ** (n + 1)) / n)
    total *= mp.mpf(2) ** halvings
    return mp.matrix([total[2, 1], total[0, 2], total[1, 0], total[0, 3], total[1, 3], total[2, 3]])


def adjoint(m):
    r, t = m[:3, :3], m[:3, 3]
    out = mp.zeros(6)
    out[:3, :3], out[3:, 3:], out[3:, :3] = r, r, hat(t) * r
    return out


def small_adjoint(xi):
    out = mp.zeros(6)
    out[:3, :3], out[3:, 3:], out[3:, :3] = hat(xi[:3]), hat(xi[:3]), hat(xi[3:])
    return out


def inverse_right_jacobian(xi):
    ad = small_adjoint(xi)
    series = {2: mp.mpf(1) / 12, 4: -mp.mpf(1) / 720, 6: mp.mpf(1) / 30240, 8: -mp.mpf(1) / 1209600}
    return mp.eye(6) + ad / 2 + sum((ad**n * c for n, c in series.items()), mp.zeros(6))


# (3): the coefficients are B_n / n!, and the next one is the 2.1e-8 of the text.
for n, coefficient in [(2, "1/12"), (4, "-1/720"), (6, "1/30240"), (8, "-1/1209600")]:
    assert sp.bernoulli(n) / sp.factorial(n) == sp.Rational(coefficient)
assert abs(sp.bernoulli(10) / sp.factorial(10) - 2.0877e-8) < 1e-12

# (2), (4): r, its derivative by a motion of D, and of either place. Steps of 1e-15 leave 1e-15.
h = mp.mpf("1e-15")
for size in ["1e-3", "0.03", "0.15"]:
    r = matrix(6, 1, mp.mpf(size) / 2)
    p_a, p_b = exp(matrix(6, 1, mp.mpf("0.5"))), exp(matrix(6, 1, mp.mpf("0.5")))
    d = p_b * p_a**-1
    m = exp(r) * d
    assert mp.norm(log(m * d**-1) - r) < 1e-25
    j = inverse_right_jacobian(r)
    for k in range(6):
        step = mp.zeros(6, 1)
        step[k] = h
        by_b = (r - log(m * (exp(step) * p_b * p_a**-1) ** -1)) / h
        by_a = (r - log(m * (p_b * (exp(step) * p_a) ** -1) ** -1)) / h
        assert mp.norm(by_b - j[:, k]) < 1e-13
        assert mp.norm(by_a + j * adjoint(d)[:, k]) < 1e-13

# (8), (10): of a linear problem, the redundancies add up to the degrees of freedom, and leaving a pair out lowers chi^2 by T.
pairs, unknowns = 7, 18
rows = [matrix(6, unknowns) for _ in range(pairs)]
roots = [matrix(6, 6) + 3 * mp.eye(6) for _ in range(pairs)]
sigma = [x * x.T for x in roots]
data = [matrix(6, 1) for _ in range(pairs)]


def solve(used):
    n, g = mp.zeros(unknowns), mp.zeros(unknowns, 1)
    for k in used:
        n += rows[k].T * sigma[k] ** -1 * rows[k]
        g += rows[k].T * sigma[k] ** -1 * data[k]
    p = n**-1
    x = p * g
    residuals = [y - a * x for a, y in zip(rows, data)]
    return p, residuals, sum((residuals[k].T * sigma[k] ** -1 * residuals[k])[0] for k in used)


p, residuals, chi2 = solve(range(pairs))
q = [a * p * a.T for a in rows]
redundancy = sum(6 - sum((q[k] * sigma[k] ** -1)[i, i] for i in range(6)) for k in range(pairs))
assert abs(redundancy - (6 * pairs - unknowns)) < 1e-25
distance = (residuals[2].T * (sigma[2] - q[2]) ** -1 * residuals[2])[0]
p_without, others, chi2_without = solve([k for k in range(pairs) if k != 2])
assert abs(chi2 - distance - chi2_without) < 1e-25
q_without = rows[2] * p_without * rows[2].T
assert abs(distance - (others[2].T * (sigma[2] + q_without) ** -1 * others[2])[0]) < 1e-25


# (11): how often F passes the gate 3.719 by chance, against the exact distribution: never more than once in ten thousand.
def tail_of_f(f, n):
    return mp.betainc(n / mp.mpf(2), 3, 0, n / (n + 6 * f), regularized=True)


for n, expected in [(6, 0.22), (12, 0.74), (18, 0.87), (60, 0.88), (600, 0.81)]:
    own, rest = mp.mpf(2) / 54, mp.mpf(2) / (9 * n)
    gate = lambda f: ((1 - rest) * mp.cbrt(f) - (1 - own)) / mp.sqrt(rest * mp.cbrt(f) ** 2 + own) - mp.mpf("3.719")
    low, high = mp.mpf(1), mp.mpf(10) ** 6
    for _ in range(200):
        middle = mp.sqrt(low * high)
        low, high = (middle, high) if gate(middle) < 0 else (low, middle)
    chance = tail_of_f(low, n) / mp.mpf("1e-4")
    assert abs(chance - expected) < 0.01, (n, chance)

# (12): motions of both places, carried to frame b.
p_a, p_b = exp(matrix(6, 1, mp.mpf("0.5"))), exp(matrix(6, 1, mp.mpf("0.5")))
d = p_b * p_a**-1
tiny_a, tiny_b = matrix(6, 1, mp.mpf("1e-15")), matrix(6, 1, mp.mpf("1e-15"))
moved = log((exp(tiny_b) * p_b) * (exp(tiny_a) * p_a) ** -1 * d**-1)
assert mp.norm(moved - (tiny_b - adjoint(d) * tiny_a)) < 1e-28

print("pose_graph.md: all equations hold")
