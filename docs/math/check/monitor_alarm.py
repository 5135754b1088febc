"""docs/math/monitor.md sections 4 and 10: eqs. (46), (47), (50), (80) and (115)-(117)."""

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

# (115) is an identity: means of 2^j numbers differ from the mean of all by a quarter of the squared differences of all longer blocks.
y = np.cumsum(rng.normal(0, 1, 1024)) + 5 * (rng.uniform(0, 1, 1024) < 0.1)


def differences(values):
    squares = []
    while len(values) > 1:
        squares.append(np.mean((values[1::2] - values[::2]) ** 2))
        values = 0.5 * (values[1::2] + values[::2])
    return np.array(squares)


a = differences(y)
for j in range(10):
    means = y.reshape(-1, 2**j).mean(axis=1)
    assert np.isclose(np.mean((means - y.mean()) ** 2), a[j:].sum() / 4)
# Of white errors they are the variance of a mean, a_0/2n.
white = differences(rng.normal(0, 1, 2**20))
assert all(abs(white[j:].sum() / 4 * 2**j - 1) < 0.1 for j in range(8)), white
assert np.allclose(white[:10] * 2.0 ** np.arange(10), white[0], rtol=0.15)

# (116): a lamp that is on for 20 and off for 40 readings in the mean, and shifts by one standard deviation of a reading: a step from a mean of n0
# readings to one of n is known as well as (115) says, and not by averages of white errors.
leaves = np.array([1 / 40, 1 / 20])
state, lamp = 0, []
chance = rng.uniform(0, 1, 2**19)
for u in chance:
    state = 1 - state if u < leaves[state] else state
    lamp.append(state)
y = np.array(lamp) + rng.normal(0, 1, len(lamp))
a = differences(y)
variance = lambda n: a[int(np.ceil(np.log2(n))):].sum() / 4
for n0, n in ((4096, 4), (4096, 64), (512, 512)):
    starts = np.arange(n0, len(y) - n, 997)
    errors = np.array([y[s : s + n].mean() - y[s - n0 : s].mean() for s in starts])
    assert 0.75 < np.mean(errors**2) / (variance(n0) + variance(n)) < 1.3, (n0, n)
assert np.mean(errors**2) > 5 * (1 / n0 + 1 / n)

# (117): whether h is in the motion or not, its part of the normalised squared error is below one.
c = rng.normal(0, 1, (6, 6))
c = c @ c.T
for size in (0.1, 1.0, 100.0):
    h = size * rng.normal(0, 1, 6)
    assert h @ np.linalg.solve(c + np.outer(h, h), h) < 1
