"""Checks docs/math/monitor.md, section 8: the ratio that tests the readings a reference is learned from."""

import numpy as np

rng = np.random.default_rng(20041)
n = 30
t = np.arange(n, dtype=float)
contrasts = np.hstack([-np.ones((n - 1, 1)), np.eye(n - 1)])


def covariance(sigma, time):
    """Of the contrasts with the first reading: white noise of one and a correlated error."""
    full = np.eye(n) + sigma**2 * np.exp(-np.abs(t[:, None] - t[None, :]) / time)
    return contrasts @ full @ contrasts.T


def log_density(y, p):
    factor = np.linalg.cholesky(p)
    z = np.linalg.solve(factor, y)
    return -0.5 * (z**2).sum(axis=0) - np.log(np.diag(factor)).sum()


grid = [(0.0, 1.0)] + [(s, tau) for s in (0.5, 1, 2, 4, 8) for tau in (0.3, 3, 30, 300)]
null = [covariance(s, tau) for s, tau in grid]
changes = []
for k in range(3, n - 3):
    step, ramp = contrasts @ (t >= k), contrasts @ (np.maximum(t - k, 0) / t[-1])
    for p in (null[0], covariance(1, 4)):
        for g in (step, ramp):
            for size in (5, 50):
                changes.append(p + size**2 * np.outer(g, g))


def log_e(y):
    numerator = np.logaddexp.reduce([log_density(y, p) for p in changes], axis=0) - np.log(len(changes))
    return numerator - np.max([log_density(y, p) for p in null], axis=0)


# (29), (30): the mean of e under each noise of the class is at most one, and large e are as rare as Markov says.
for sigma, time in [(0.0, 1.0), (1, 3), (4, 30), (8, 300)]:
    y = np.linalg.cholesky(covariance(sigma, time)) @ rng.standard_normal((n - 1, 4000))
    e = np.exp(log_e(y))
    assert e.mean() < 1.0 and (e >= 20).mean() <= 1 / 20, (sigma, time, e.mean())
print("ok  (29), (30) a mean of at most one for every correlated error")

# A likelihood ratio whose noise is taken to be white has no such bound.
y = np.linalg.cholesky(covariance(4, 30)) @ rng.standard_normal((n - 1, 400))
white = np.logaddexp.reduce([log_density(y, p) for p in changes], axis=0) - np.log(len(changes))
assert (white - log_density(y, null[0]) > np.log(4e4)).mean() > 0.5
print("ok  why the noise is not taken to be white")

# A step is found amid white noise.
y = contrasts @ (12.0 * (t >= 15))[:, None] + np.linalg.cholesky(null[0]) @ rng.standard_normal((n - 1, 200))
assert (log_e(y) > np.log(4e4)).mean() > 0.9
print("ok  a step of twelve standard deviations is found")

# Terms of the numerator: p(y | change) = p(y | none) Λ, Λ of (8) with c = g' P⁻¹ y and d = g' P⁻¹ g.
p, g, size = covariance(1, 4), contrasts @ (t >= 11), 5.0
y = rng.standard_normal(n - 1)
c, d = g @ np.linalg.solve(p, y), g @ np.linalg.solve(p, g)
log_ratio = 0.5 * size**2 * c**2 / (1 + size**2 * d) - 0.5 * np.log1p(size**2 * d)
assert abs(log_density(y, p + size**2 * np.outer(g, g)) - log_density(y, p) - log_ratio) < 1e-9
print("ok  (8) is the ratio with and without a change")

# (31): a mean of ratios that are wholly correlated is bounded as each of them is.
y = np.linalg.cholesky(null[0]) @ rng.standard_normal((n - 1, 4000))
both = 0.5 * (np.exp(log_e(y)) + np.exp(log_e(-y)))
assert both.mean() < 1.0
print("ok  (31) a mean over directions")

# (32): of all directions P⁻¹ e_i shows a change of coordinate i best.
a = rng.standard_normal((6, 6))
p = a @ a.T + 0.1 * np.eye(6)
information = np.linalg.inv(p)
best = information[:, 2] @ np.eye(6)[2] / np.sqrt(information[:, 2] @ p @ information[:, 2])
others = rng.standard_normal((6, 2000))
shown = np.abs(others[2]) / np.sqrt(np.einsum("ij,ik,kj->j", others, p, others))
assert shown.max() <= best + 1e-12
print("ok  (32) the direction that shows one coordinate best")

# (33): the scatter of a correlated error between two readings a span apart.
sigma, time, span = 3.0, 20.0, 50.0
between = 2 * sigma**2 * (1 - np.exp(-span / time))
start = sigma * rng.standard_normal(400000)
end = np.exp(-span / time) * start + sigma * np.sqrt(1 - np.exp(-2 * span / time)) * rng.standard_normal(400000)
assert abs(((end - start) ** 2).mean() / between - 1) < 0.01
print("ok  (33) what a correlated error does within the span")
