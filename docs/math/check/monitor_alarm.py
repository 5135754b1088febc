"""docs/math/monitor.md sections 4 and 10: eqs. (46), (47), (50) and (80)."""

import numpy as np
import sympy as sp

# (46): variance of the difference of neighbouring means of an error with autocorrelation exp(-|s|/tau), T = x tau.
x, a, b = sp.symbols("x a b", positive=True)
inner = sp.integrate(sp.exp(b - a), (b, 0, a))  # b < a < x, both in units of tau
variance = 2 * sp.integrate(inner, (a, 0, x)) / x**2
shared = sp.integrate(sp.integrate(sp.exp(b - a), (b, 0, x)), (a, x, 2 * x)) / x**2
lost = 1 - sp.exp(-x)
stated = 4 / x**2 * (x - lost - lost**2 / 2)
assert sp.simplify(2 * (variance - shared) - stated) == 0
assert abs(float(stated.subs(x, 1)) - 0.672) < 5e-4
assert sp.limit(stated / x, x, 0) == sp.Rational(4, 3)

# (47): errors f times as large as the model says; ln Lambda of (8) as it is and as it should be.
rng = np.random.default_rng(36)
gamma = 4.0
for f2 in (1.5, 4.0, 10.0):
    d = rng.uniform(50, 500, 20000)
    c = rng.normal(0, np.sqrt(30 * d))
    false = -0.5 * np.log1p(gamma * d) + 0.5 * gamma * c**2 / (1 + gamma * d)
    true = -0.5 * np.log1p(gamma * d / f2) + 0.5 * gamma * (c / f2) ** 2 / (1 + gamma * d / f2)
    # Of the exponent nothing is lost but the share that the size's prior keeps.
    exponent = (false + 0.5 * np.log1p(gamma * d)) / f2 - 0.5 * np.log1p(gamma * d / f2)
    assert np.max(np.abs(exponent - true) / (1 + np.abs(true))) < 0.1

# (50): a camera that stays where it was found (D = 1 sigma away) is said to be back at most once in 1100.
runs, readings = 4000, 2000
y = 1.0 + rng.normal(0, 1, (runs, readings))
n = np.arange(1, readings + 1)
mean = np.cumsum(y, axis=1) / n
odds = n * ((mean - 1.0) ** 2 - mean**2)
assert (odds.max(axis=1) > 14).mean() < 3 / 1100
y -= 1.0
mean = np.cumsum(y, axis=1) / n
odds = n * ((mean - 1.0) ** 2 - mean**2)
first = np.argmax((odds > 14) & (n * mean**2 < 5.35), axis=1) + 1
assert np.mean(first) < 40, np.mean(first)  # D^2/2 sigma^2 a reading: about 14 of them for 14/2

# (80): a change between two readings a time D apart, reported as of the later one.
error = rng.uniform(0, 1, 200000)
assert abs(np.sqrt(np.mean(error**2)) - 1 / np.sqrt(3)) < 3e-3
assert abs(np.mean(error < 1 / np.sqrt(3)) - 0.577) < 4e-3 and np.all(error <= 1)
# Together with a wrong onset, by a number of readings of standard deviation s, +- sigma holds at least what it does of a normal error.
for s in (0.0, 0.3, 1.0, 3.0):
    away = np.abs(error + np.rint(rng.normal(0, s, error.size)))
    spread = np.sqrt(np.mean(np.rint(rng.normal(0, s, error.size)) ** 2))
    assert np.mean(away <= np.hypot(spread, 1)) > 0.683, s
print("ok")
