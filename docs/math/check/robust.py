"""Proves docs/math/robust.md: residual without the lens, Chernoff's bound, Wald's test, shares of a truncated residual, derivatives."""

import math
import random

import mpmath as mp
import sympy as sp

# (1)–(3): pinhole, exact.
x, y, z, f = sp.symbols("x y z f", positive=True)
bx, by, bz = sp.symbols("b_x b_y b_z", positive=True)
X = sp.Matrix([x, y, z])
pixel = sp.Matrix([f * x / z, f * y / z])
jacobian = pixel.jacobian(X)
at_b = {x: bx, y: by, z: bz}
Pi = jacobian.subs(at_b, simultaneous=True)
b = sp.Matrix([bx, by, bz])
assert sp.simplify(Pi * b) == sp.zeros(2, 1)
D = sp.Matrix([[0, 0, 1 / bz]])
e = Pi * X / (D * X)[0]
assert sp.simplify(e - (pixel - pixel.subs(at_b, simultaneous=True))) == sp.zeros(2, 1)

# (11)
derivative = e.jacobian(X)
assert sp.simplify(derivative - (Pi - e * D) / (D * X)[0]) == sp.zeros(2, 3)

# (1) for a lens that is no pinhole: the equidistant fisheye, error of second order.
def fisheye(v):
    r = mp.sqrt(v[0] ** 2 + v[1] ** 2)
    theta = mp.atan2(r, v[2])
    return [380 * theta * v[0] / r, 380 * theta * v[1] / r]


def rows(v):
    h = mp.mpf(10) ** -15
    step = lambda k, s: [v[i] + (s if i == k else 0) for i in range(3)]
    return [[(fisheye(step(k, h))[i] - fisheye(step(k, -h))[i]) / (2 * h) for k in range(3)] for i in range(2)]


mp.mp.dps = 40
bearing = [mp.mpf("0.8"), mp.mpf("-0.36"), mp.mpf("-0.48")]  # 119° off the axis
norm = mp.sqrt(sum(c * c for c in bearing))
bearing = [c / norm for c in bearing]
slope = rows(bearing)
assert all(abs(sum(slope[i][k] * bearing[k] for k in range(3))) < 1e-20 for i in range(2))
errors = []
for size in (mp.mpf("1e-2"), mp.mpf("1e-3")):
    v = [3 * (bearing[k] + size * d) for k, d in enumerate((mp.mpf("0.3"), mp.mpf("0.9"), mp.mpf("-0.2")))]
    along = sum(bearing[k] * v[k] for k in range(3))
    first_order = [sum(slope[i][k] * v[k] for k in range(3)) / along for i in range(2)]
    exact = [p - q for p, q in zip(fisheye(v), fisheye(bearing))]
    errors.append(mp.sqrt(sum((a - c) ** 2 for a, c in zip(exact, first_order))))
assert errors[1] < errors[0] / 90, errors  # a tenth of the step, a hundredth of the error

# (5) against the exact tail; (6) gives the numbers in the text.
mp.mp.dps = 30


def ln_bound(n, k, p):
    if k <= n * p:
        return 0.0
    misses = (n - k) * math.log((n - k) / (n * (1 - p))) if k < n else 0.0
    return -(k * math.log(k / (n * p)) + misses)


for n, p in ((9, 4e-4), (300, 4e-4), (300, 0.1)):
    for k in range(1, min(n, 60) + 1):
        exact = mp.fsum(mp.binomial(n, j) * mp.mpf(p) ** j * (1 - mp.mpf(p)) ** (n - j) for j in range(k, n + 1))
        assert mp.log(exact) <= ln_bound(n, k, p) + 1e-9, (n, k, p)

chance = math.pi * 12**2 / (1288 * 968)


def needed(n):
    alarms = lambda m: math.log(4 * math.comb(n, 3)) + ln_bound(n - 3, m - 3, chance)
    return next(m for m in range(4, n + 1) if alarms(m) <= math.log(1e-3))


assert [needed(n) for n in (6, 12, 20, 1000)] == [5, 6, 6, 15], [needed(n) for n in (6, 12, 20, 1000)]

# (8): a good pose is given up at most once in a hundred, whatever the order. Seeded.
chance_of = random.Random(8)
good, bad = 0.2, 0.02
hit, miss = math.log(bad / good), math.log((1 - bad) / (1 - good))
assert abs(good * math.exp(hit) + (1 - good) * math.exp(miss) - 1) < 1e-12  # the martingale
trials = 10000
given_up, looked_at = 0, 0
for _ in range(trials):
    ratio = 0.0
    for _ in range(500):
        ratio += hit if chance_of.random() < good else miss
        if math.log(100) < ratio:
            given_up += 1
            break
    ratio = 0.0
    for j in range(500):
        looked_at += 1
        ratio += hit if chance_of.random() < bad else miss
        if math.log(100) < ratio:
            break
assert given_up / trials < 0.01 + 3 * math.sqrt(0.01 / trials), given_up
print(f"a good pose is given up in {given_up / trials:.4f}, a bad one costs {looked_at / trials:.1f} points")

# (12) by counting, groups of every kind.
from itertools import permutations

for sizes, is_good in (
    ([1, 1, 1, 1, 1], [1, 1, 1, 0, 1]),
    ([4, 2, 1, 1, 1], [1, 0, 1, 1, 0]),
    ([4, 4, 3, 1], [1, 1, 0, 1]),
):
    n, hits, total = len(sizes), 0, 0
    for a, c, d in permutations(range(n), 3):
        takes = (a, c, d) if sizes[a] == sizes[c] == 1 else (a, c)
        total += 1
        hits += all(is_good[g] for g in takes)
    g = sum(is_good)
    s = sum(1 for size, ok in zip(sizes, is_good) if ok and size == 1)
    formula = (g * (g - 1) - s * (s - 1)) / (n * (n - 1)) + s * (s - 1) / (n * (n - 1)) * (g - 2) / (n - 2)
    assert abs(hits / total - formula) < 1e-12, (sizes, hits / total, formula)

# (14): |e|²/2σ² is exponential; the mean of what is below τ, over the mean of all.
tau, v = sp.symbols("tau v", positive=True)
kept = sp.integrate(sp.exp(-v), (v, 0, tau))
below = sp.integrate(v * sp.exp(-v), (v, 0, tau))
kappa = 1 - tau / (sp.exp(tau) - 1)
assert sp.simplify(below / kept - kappa) == 0
# (15): E[∂(w e)/∂e] over a Gaussian is E[w e eᵀ]/σ² (Stein): the same integral, so that the ratio is 1/((1 − e^−τ) κ).
sandwich = below / below**2
stated = 1 / kept
assert sp.simplify(sandwich / stated - 1 / kappa) == 0
for t, lost, share in ((2, 0.135, 0.687), (2.5, 0.044, 0.856), (3, 0.011, 0.949), (4, 3.4e-4, 0.9973)):
    value = float(kappa.subs(tau, t * t / 2))
    assert abs(value - share) < 6e-4 and abs(math.exp(-t * t / 2) / lost - 1) < 0.02, (t, value)
    on_s, on_all = value**-0.5 - 1, ((1 - math.exp(-t * t / 2)) * value) ** -0.5 - 1
    print(f"T = {t} σ: κ {value:.5f}, σ larger by {100 * on_s:.2f} % of stated, {100 * on_all:.2f} % of all")
print("robust.md: proved")
