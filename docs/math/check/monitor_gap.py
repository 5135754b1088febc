"""docs/math/monitor.md section 13: eqs. (90) to (94)."""

import math

import numpy as np

HOUR = 3600.0


def spread(variance, steady, time, gap, watched):
    """(90), (91): the variance of an error after a gap, in variances of a reading."""
    known = min(gap, max(watched, 60.0)) if watched < 86400 else gap
    kept = np.exp(-known / time)
    after = steady + kept**2 * (variance - steady)
    return min(after + min((gap - known) / HOUR, 24), max(after, steady))


# As the model itself says where the gap is no longer than what was watched: simulated.
rng = np.random.default_rng(90)
for steady, time, gap in ((0.3, 30, 60.0), (20, 400, 600.0), (80, 5500, 600.0)):
    b = rng.normal(0, np.sqrt(0.1), 200000)
    step = gap / 200
    kept = np.exp(-step / time)
    for _ in range(200):
        b = kept * b + rng.normal(0, np.sqrt(steady * (1 - kept**2)), b.size)
    assert abs(b.var() / spread(0.1, steady, time, gap, 600.0) - 1) < 0.02
# Never more than it ever has; bounded where the gap is longer, whatever the model; unbounded after a day of watching.
for gap in np.geomspace(60, 1e7, 40):
    for steady, time in ((0.3, 30), (5, 400), (20, 20000), (80, 5500), (80, 93312), (300, 1e6)):
        after = spread(0.1, steady, time, gap, 600.0)
        assert after <= steady + 1e-9
        assert after <= spread(0.1, steady, time, min(gap, 600.0), 600.0) + 24 + 1e-9
assert spread(0.1, 80, 20000, 8 * HOUR, 600.0) < 13 < spread(0.1, 80, 20000, 8 * HOUR, 86400.0)
# The text: standard deviations of a reading gained in 8 hours and in a day.
assert abs(np.sqrt(8) - 2.8) < 0.05 and abs(np.sqrt(24) - 4.9) < 0.05

# (92): the mean of n readings beside a reference from N, six numbers: chi^2 has the mean six.
n, N = 60, 50
error = rng.normal(0, 1, (20000, n, 6)).mean(axis=1) - rng.normal(0, 1, (20000, N, 6)).mean(axis=1)
chi2 = (error**2 / (1 / n + 1 / N)).sum(axis=1)
assert abs(chi2.mean() - 6) < 0.1
# (94): one look in 10^4.
assert (rng.chisquare(6, 10**6) > 27.9).mean() < 2e-4

# (93): of white noise the mean of n readings, beside a reference from 50, is beyond the promise (44) of as many in one camera of 10^4 at most.
evidence = np.log(86400 * 30 / 0.2) - np.log(1 / 0.2) + 2 + np.log(15 / 0.9) + 5
root = 1.28 + np.sqrt(1.28**2 + 2 * evidence)
assert abs(root - 8.4) < 0.1, root
for n in (1, 3, 8, 21, 60):
    beyond = root / np.sqrt(n) / np.sqrt(1 / n + 1 / 50) - 1
    assert 6 * math.erfc(beyond / math.sqrt(2)) < 1e-4, n
print("ok")
