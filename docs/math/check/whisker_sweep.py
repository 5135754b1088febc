"""Checks docs/math/whisker_sweep.md: (0), (6), (7), its derivative, (11)-(15), (18)-(19), symbolically and at random to 40 digits. Needs SymPy and mpmath."""

import random

import mpmath as mp
import sympy as sp

mp.mp.dps = 40
random.seed(3)


def rand(rows, cols=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)))


def close(a, b, tolerance=mp.mpf("1e-28")):
    assert mp.norm(mp.matrix([a - b]) if not isinstance(a, mp.matrix) else a - b) < tolerance, (a, b)


# (0): cantilever loaded at s: y = F s^3 / 3EI and M = F s.
force, s, ei = sp.symbols("F s EI", positive=True)
u = sp.symbols("u", positive=True)
deflection = sp.integrate(force * (s - u) / ei * (s - u), (u, 0, s))
assert sp.simplify(deflection - (force * s) * s**2 / (3 * ei)) == 0

# (6): exact on a circle, between any two of its tangents.
a1, a2, r = sp.symbols("a1 a2 r", real=True)
point = lambda a: sp.Matrix([r * sp.sin(a), -r * sp.cos(a)])  # tangent direction a
shift = point(a2) - point(a1)
middle = (a1 + a2) / 2
assert sp.simplify(sp.expand_trig((-sp.sin(middle) * shift[0] + sp.cos(middle) * shift[1]).rewrite(sp.exp)).expand()) == 0

# Bound before (7): a cone of both tangents; and the variance of a uniform error of that half width for small angles.
for _ in range(200):
    a, b, turn = mp.mpf(random.random()), mp.mpf(random.random()), mp.mpf(random.uniform(-0.5, 0.5))
    delta = mp.matrix([a + b * mp.cos(turn), b * mp.sin(turn)])
    e = -mp.sin(turn / 2) * delta[0] + mp.cos(turn / 2) * delta[1]
    assert abs(e) <= mp.norm(delta) * abs(mp.sin(turn / 2)) * (1 + mp.mpf("1e-30"))
half = sp.symbols("h", positive=True)
x = sp.symbols("x", real=True)
assert sp.integrate(x**2 / (2 * half), (x, -half, half)) == half**2 / 3  # (|D| t / 2)^2 / 3 = (|D| t)^2 / 12

# Its derivative by an angle: -1/2 t.D.
d1, d2 = sp.symbols("D1 D2", real=True)
e = -sp.sin(middle) * d1 + sp.cos(middle) * d2
assert sp.simplify(e.diff(a1) + (sp.cos(middle) * d1 + sp.sin(middle) * d2) / 2) == 0

# (11)-(14) against the dense inverse: five nodes of three, one shared unknown.
nodes, size = 5, 3
full = nodes * size + 1
rows = []
for i in range(nodes):
    for _ in range(6):
        row = mp.zeros(1, full)
        span = range(i * size, min((i + 2) * size, nodes * size))
        for k in list(span) + [full - 1]:
            row[0, k] = mp.mpf(random.gauss(0, 1))
        rows.append((row, mp.mpf(random.gauss(0, 1))))
hessian, gradient = mp.zeros(full), mp.zeros(full, 1)
for row, residual in rows:
    hessian += row.T * row
    gradient += row.T * residual
inverse = hessian**-1
step = -inverse * gradient
part = lambda m, i, j: m[i * size : (i + 1) * size, j * size : (j + 1) * size]
diagonal = [part(hessian, i, i) for i in range(nodes)]
upper = [part(hessian, i, i + 1) for i in range(nodes - 1)]
border = [hessian[i * size : (i + 1) * size, full - 1] for i in range(nodes)]
slope = [gradient[i * size : (i + 1) * size, 0] for i in range(nodes)]
corner, gamma = hessian[full - 1, full - 1], gradient[full - 1]
inverses = []
for i in range(nodes):
    inverses.append(diagonal[i] ** -1)
    if i + 1 < nodes:
        diagonal[i + 1] = diagonal[i + 1] - upper[i].T * inverses[i] * upper[i]
        border[i + 1] = border[i + 1] - upper[i].T * inverses[i] * border[i]
        slope[i + 1] = slope[i + 1] - upper[i].T * inverses[i] * slope[i]
    if i == 0:
        # (19): what is left of the first node is the Schur complement of the whole.
        rest = hessian[size:, size:] - hessian[size:, :size] * inverses[0] * hessian[:size, size:]
        close(diagonal[1], rest[:size, :size])
    corner -= (border[i].T * inverses[i] * border[i])[0]
    gamma -= (border[i].T * inverses[i] * slope[i])[0]
shared = -gamma / corner
close(shared, step[full - 1])
z, cov, with_shared = [None] * nodes, [None] * nodes, [None] * nodes
variance = 1 / corner
for i in reversed(range(nodes)):
    k = -inverses[i] * border[i]
    z[i] = -inverses[i] * slope[i] + k * shared
    cov[i] = inverses[i] + k * k.T * variance
    with_shared[i] = k * variance
    if i + 1 < nodes:
        big = -inverses[i] * upper[i]
        z[i] += big * z[i + 1]
        mixed = big * with_shared[i + 1] * k.T
        cov[i] += big * cov[i + 1] * big.T + mixed + mixed.T
        with_shared[i] += big * with_shared[i + 1]
        close(big * cov[i + 1] + k * with_shared[i + 1].T, part(inverse, i, i + 1))
    close(z[i], step[i * size : (i + 1) * size, 0])
    close(cov[i], part(inverse, i, i))
    close(with_shared[i], inverse[i * size : (i + 1) * size, full - 1])

# (15): least squares' residuals have covariance W^-1 - J P J^T: with the hat matrix, (I - H)(I - H)^T = I - H.
jacobian = rand(9, 4)
hat = jacobian * (jacobian.T * jacobian) ** -1 * jacobian.T
left = mp.eye(9) - hat
close(left * left.T, left)

# (18): the probability of an alternative of which the likelihood is exp(-D/2) times the other's.
odds = sp.exp(-sp.symbols("D") / 2)
assert sp.simplify(odds / (1 + odds) - 1 / (1 + 1 / odds)) == 0

print("whisker_sweep.md: (0), (6), (7), (11)-(15), (18), (19) hold")
