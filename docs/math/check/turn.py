"""Checks docs/math/turn.md: (2) and (7) by differentiation, (4) by integration, (5)'s expectation, (9), (10) and (11) exactly, the spline's
alias of (12). Needs SymPy."""

import random

import sympy as sp
from mpmath import diff, exp, eye, inverse, log, matrix, mp, mpf, quad

mp.dps = 50
random.seed(11)
TINY = mpf(10) ** -25


def rnd():
    return mpf(random.uniform(-1, 1))


def cross_matrix(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exp_so3(w):
    k = cross_matrix(w)
    total, term = eye(3), eye(3)
    for n in range(1, 60):
        term = term * k / n
        total = total + term
    return total


# (2): the derivative of a pinhole's pixel by a left turn; (7) is its square.
def project(y):
    return matrix([900 * y[0] / y[2] + 320, 880 * y[1] / y[2] + 240])


y = matrix([mpf("0.2"), mpf("-0.3"), mpf("1.1")])
slope = matrix([[900 / y[2], 0, -900 * y[0] / y[2] ** 2], [0, 880 / y[2], -880 * y[1] / y[2] ** 2]])
j = -slope * cross_matrix(y)
for axis in range(3):
    for row in range(2):

        def moved(t, axis=axis, row=row):
            w = matrix(3, 1)
            w[axis] = t
            return project(exp_so3(w) * y)[row]

        assert abs(diff(moved, 0) - j[row, axis]) < TINY * 10**10, (axis, row)

# (4): mean of chi-squared with two degrees of freedom below c², over two.
c2 = 2 * log(1000)
kept = quad(lambda x: x * exp(-x / 2) / 2, [0, c2]) / (1 - exp(-c2 / 2)) / 2
k = 1 - (c2 / 2) * exp(-c2 / 2) / (1 - exp(-c2 / 2))
assert abs(kept - k) < TINY and abs(k - mpf("0.993085")) < mpf("5e-7"), k

# (5): with independent errors the sum over neighbourhoods has that mean, whatever the landmarks.
rows = [[matrix([[rnd() for _ in range(3)] for _ in range(2)]) for _ in range(4)] for _ in range(5)]
h_n = [sum((a.T * a for a in group), matrix(3, 3)) for group in rows]
h = sum(h_n, matrix(3, 3))
h_inverse = inverse(h)


def trace(m):
    return sum(m[i, i] for i in range(3))


# G_N = Σ_{i in N} Jᵢᵀ(eᵢ − Jᵢ H⁻¹ Σ Jᵀe): its covariance, from the linear map itself.
expected = mpf(0)
for n, group in enumerate(rows):
    covariance = matrix(3, 3)
    for m, other in enumerate(rows):
        for a in other:
            gain = (eye(3) if m == n else matrix(3, 3)) * a.T - h_n[n] * h_inverse * a.T
            covariance += gain * gain.T
    expected += trace(h_inverse * covariance)
claimed = 3 - sum(trace(h_inverse * g * h_inverse * g) for g in h_n)
assert abs(expected - claimed) < TINY

# (9): δ with gain and offset fitted together is δ with gradients made orthogonal to both.
size = 9
t = [rnd() for _ in range(size)]
mean = sum(t) / size
t = [x - mean for x in t]
gradients = [[rnd() for _ in range(size)] for _ in range(2)]
image = [rnd() for _ in range(size)]
mean = sum(image) / size
image = [x - mean for x in image]
design = matrix(size, 4)
for i in range(size):
    design[i, 0], design[i, 1], design[i, 2], design[i, 3] = gradients[0][i], gradients[1][i], t[i], 1
joint = inverse(design.T * design) * design.T * matrix(image)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


flat = []
for g in gradients:
    g = [x - sum(g) / size for x in g]
    share = dot(g, t) / dot(t, t)
    flat.append([x - share * y for x, y in zip(g, t)])
m = matrix([[dot(a, b) for b in flat] for a in flat])
alone = inverse(m) * matrix([dot(g, image) for g in flat])
# The joint fit is of I = a T + δ'ᵀ∇T + o, with δ' = a δ.
assert abs(alone[0] - joint[0]) < TINY and abs(alone[1] - joint[1]) < TINY

# (11): what a bend T² adds to the image, the estimator of (9) takes for this shift, added to the true one.
bent = matrix([i + mpf("0.003") * x * x for i, x in zip(image, t)])
squares = matrix([x * x for x in t])
shifted = inverse(m) * matrix([dot(g, bent) for g in flat])
told = alone + inverse(m) * matrix([dot(g, squares) for g in flat]) * mpf("0.003")
assert abs(shifted[0] - told[0]) < TINY and abs(shifted[1] - told[1]) < TINY

# (10), along one line: noise of the pixels through the spline, its weights against those spread over the pixels.
smooth = matrix(size, size + 2)
for i in range(size):
    smooth[i, i], smooth[i, i + 1], smooth[i, i + 2] = mpf(1) / 6, mpf(4) / 6, mpf(1) / 6
of_samples = smooth * smooth.T
assert abs(of_samples[3, 3] - mpf(1) / 2) < TINY
for g in flat:
    by_samples = (matrix(g).T * of_samples * matrix(g))[0]
    spread = smooth.T * matrix(g)
    assert abs(by_samples - (spread.T * spread)[0]) < TINY

# (12): the cubic B-spline's alias at half the Nyquist frequency, as a shift.
w = mp.pi / 2
alias = (mp.sincpi(w / (2 * mp.pi) - 1) / mp.sincpi(w / (2 * mp.pi))) ** 4
assert abs(alias / w - mpf("0.0079")) < mpf("0.0001"), alias / w

# (8) of monitor.md with readings ρ times weaker: below one, and summed over all onsets below √(ρA)·2/√Γ.
n, rho, gamma = sp.symbols("n rho gamma", positive=True)
total = sp.integrate(1 / sp.sqrt(1 + gamma * n / rho), (n, 0, sp.Symbol("A", positive=True)))
bound = 2 * sp.sqrt(rho * sp.Symbol("A", positive=True) / gamma)
assert sp.limit((total / bound).subs({rho: 10**4, gamma: 4}), sp.Symbol("A", positive=True), sp.oo) == 1

print("turn.md holds")
