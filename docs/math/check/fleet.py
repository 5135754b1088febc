"""Proves equations (1)-(20) of fleet.md: exact sums, chordal means, bottom-k choices, the robust scale, evidence for steps, clocks, ramps, shares.

Run: python3 docs/math/check/fleet.py
"""

import mpmath as mp
import numpy as np

rng = np.random.default_rng(5)


def exp_rotation(w):
    angle = np.linalg.norm(w)
    if angle == 0:
        return np.eye(3)
    x, y, z = w / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def quaternion(w):
    angle = np.linalg.norm(w)
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * w / angle])


def product(a, b):
    w, v, s, u = a[0], a[1:], b[0], b[1:]
    return np.concatenate([[w * s - v @ u], w * u + s * v + np.cross(v, u)])


def check_sums():
    """(1): every order and split gives one sum; rounded sums do not."""
    x = rng.normal(size=4096) * 10.0 ** rng.integers(-6, 3, 4096)
    step = 2.0**-26
    whole = np.array([int(v) for v in np.round(x / step)], dtype=object)
    total = sum(whole) % 2**64
    for _ in range(20):
        order = rng.permutation(len(x))
        parts = np.array_split(whole[order], 7)
        assert sum(sum(part) % 2**64 for part in parts) % 2**64 == total
    floats = {float(np.cumsum(x[rng.permutation(len(x))])[-1]) for _ in range(20)}
    assert len(floats) > 1, "rounded sums should differ"
    signed = total - 2**64 if total >= 2**63 else total
    assert abs(signed * step - x.sum()) < 5 * step * np.sqrt(len(x) / 12)
    # 2^24 rows of the largest position and of the largest product reach 2^63 and no more.
    assert 2**24 * 2**13 * 2**26 == 2**63 and 2**24 * 2**39 == 2**63


def check_chordal_mean():
    """(2)-(4): the sign of a quaternion does not matter; the mean differs from that of small motions by O(theta^3)."""
    base = quaternion(np.array([0.4, -1.1, 0.7]))
    errors = []
    for theta in (0.02, 0.01, 0.005):
        motions = rng.normal(size=(200, 3)) * theta
        rotations = [product(quaternion(m), base) * rng.choice([-1, 1]) for m in motions]
        eigenvalues, vectors = np.linalg.eigh(sum(np.outer(q, q) for q in rotations))
        mean = vectors[:, np.argmax(eigenvalues)]
        off = product(mean, base * [1, -1, -1, -1])
        found = 2 * off[1:] / off[0]
        errors.append(np.linalg.norm(found - motions.mean(axis=0)) / theta**3)
    assert max(errors) < 2, errors
    r, c = exp_rotation(np.array([0.3, 0.2, -1.0])), np.array([3.0, -2.0, 9.0])
    assert np.allclose(-r.T @ (-r @ c), c)


def check_choice():
    """(5): the K smallest keys of a union are found from those of its parts."""
    keys = rng.permutation(10**5)[:5000]
    for k in (1, 9, 400):
        whole = sorted(keys)[:k]
        parts = np.array_split(rng.permutation(keys), 11)
        merged = sorted(key for part in parts for key in sorted(part)[:k])[:k]
        assert merged == whole


def check_scale():
    """(6), (7): one for white rows with right sigmas; sees a factor, not a step."""
    half = mp.gammainc(3, 0, mp.mpf("5.348120627") / 2, regularized=True)
    assert abs(half - 0.5) < 1e-9
    a = rng.normal(size=(6, 6))
    c = a @ a.T + 0.1 * np.eye(6)
    n = rng.integers(600, 900, 3000)
    y = np.array([np.linalg.cholesky(c / k) @ rng.normal(size=6) for k in n])

    def scale(y):
        d = np.diff(y, axis=0)
        of = [v @ np.linalg.solve(c / k + c / m, v) for v, k, m in zip(d, n, n[1:])]
        return np.median(of) / 5.348120627

    assert abs(scale(y) - 1) < 0.06, scale(y)
    assert abs(scale(3 * y) / scale(y) - 9) < 1e-9
    stepped = y + 1e3 * (np.arange(len(y)) > 1000)[:, None]
    assert abs(scale(stepped) - scale(y)) < 0.01


def check_instant():
    """(8): the share of the new pose in the mean of a period says when the step fell, with the stated uncertainty."""
    a = rng.normal(size=(6, 6))
    c = a @ a.T + 0.1 * np.eye(6)
    root, period = np.linalg.cholesky(c), 900.0
    delta = rng.normal(size=6) * 40
    for n in (900, 15):
        size = delta @ np.linalg.solve(c / n, delta)
        sigma, errors = period * np.sqrt(4 / (3 * size) + 1 / (3 * n**2) + 1e-4), []
        for _ in range(2000):
            # Times of the rows and of the step in units of the period; the first row comes at any time after the border.
            times, fell = (np.arange(n) + rng.uniform()) / n, rng.uniform(2 / n, 1 - 2 / n)
            mean = (times >= fell).mean() * delta + root @ rng.normal(size=6) / np.sqrt(n)
            before, after = (root @ rng.normal(size=6) / np.sqrt(3 * n) for _ in range(2))
            whole = delta + after - before
            share = whole @ np.linalg.solve(c / n, mean - before) / (whole @ np.linalg.solve(c / n, whole))
            errors.append(((1 - share) - fell) * period)
        known = period * np.sqrt(1 / size)
        assert known * 0.9 < np.std(errors) < sigma and abs(np.mean(errors)) < 0.1 * sigma, (n, np.std(errors), sigma)


def covariance(t, variances, sigma, tau, steps=(), gammas=()):
    """Of v in (9), of the contrasts with the first reading, with steps of the mean."""
    n = len(t)
    c = np.diag(variances) + sigma**2 * np.exp(-np.abs(t[:, None] - t[None]) / tau)
    for k, gamma in zip(steps, gammas):
        after = (np.arange(n) >= k).astype(float)
        c += gamma * np.outer(after, after)
    d = np.eye(n)[1:] - np.eye(n)[0]
    return d @ c @ d.T


def log_p(contrasts, c):
    root = np.linalg.cholesky(c)
    w = np.linalg.solve(root, contrasts)
    return -0.5 * np.sum(w * w, axis=0) - np.log(np.diag(root)).sum()


def check_prior():
    """(11): the weights of all sets of steps add up to one at most."""
    for n in (5, 40, 96):
        total = sum(mp.binomial(n - 1, k) * 5**k * mp.mpf("0.1") ** k / mp.binomial(n - 1, k) for k in range(1, n))
        assert 0.9 < total <= 1, total


def check_evidence():
    """(10), (12): for a camera that stays amid a correlated error the mean of each term of e is at most the weight of its set."""
    n = 24
    t, variances = np.arange(n, dtype=float), np.ones(n)
    for sigma, tau in ((0.0, 1.0), (1.0, 3.0), (4.0, 40.0)):
        true = covariance(t, variances, sigma, tau)
        v = np.linalg.cholesky(true) @ rng.normal(size=(n - 1, 20000))
        null = log_p(v, true)
        # The likeliest error is at least as likely as the true one, which makes e smaller still.
        for steps, gammas in (((9,), (25.0,)), ((6, 15), (25.0, 2500.0))):
            for other in ((0.0, 1.0), (1.0, 3.0)):
                ratio = np.exp(log_p(v, covariance(t, variances, *other, steps, gammas)) - null)
                assert ratio.mean() < 1 + 5 * ratio.std() / np.sqrt(v.shape[1]), (sigma, steps, ratio.mean())
                assert (ratio > 1000).mean() <= 1e-3 + 1e-3


def check_filter():
    """(10): a Kalman filter of mean and error gives the likelihood of the contrasts, but for a constant of the first reading."""
    n, sigma, tau = 30, 1.3, 5.0
    t, variances = np.cumsum(rng.uniform(0.5, 2, n)), rng.uniform(0.5, 2, n)
    v = rng.normal(size=n) * 3

    def walk(steps):
        x, p, total = np.zeros(2), np.diag([1e9, sigma**2]), 0.0
        for i in range(n):
            if i:
                kept = np.exp(-(t[i] - t[i - 1]) / tau)
                f = np.diag([1.0, kept])
                x, p = f @ x, f @ p @ f + np.diag([0.0, sigma**2 * (1 - kept**2)])
            p[0, 0] += dict(steps).get(i, 0.0)
            s = p.sum() + variances[i]
            nu, gain = v[i] - x.sum(), p.sum(axis=1) / s
            x, p = x + gain * nu, p - np.outer(gain, gain) * s
            if i:
                total -= 0.5 * (nu * nu / s + np.log(s))
        return total

    for steps in ((), ((7, 25.0),), ((7, 25.0), (20, 400.0))):
        direct = log_p((v[1:] - v[0])[:, None], covariance(t, variances, sigma, tau, [k for k, _ in steps], [g for _, g in steps]))[0]
        assert abs(walk(steps) - direct) < 1e-5, steps


def check_penalty():
    """(13): beta is exceeded by chi-square with six degrees of freedom once in 5e7."""
    tail = mp.gammainc(3, mp.mpf(47) / 2, regularized=True)
    assert 1.5e-8 < tail < 2.5e-8, tail


def check_size():
    """(16): the difference of two means amid a correlated error has the stated variance."""
    n, sigma, tau = 40, 2.0, 10.0
    t, side = np.arange(n, dtype=float), (np.arange(n) >= 25).astype(float)
    v = np.eye(n) + sigma**2 * np.exp(-np.abs(t[:, None] - t[None]) / tau)
    x = np.column_stack([1 - side, side])
    inverse = np.linalg.inv(x.T @ np.linalg.solve(v, x))
    z = 7.0 * side[:, None] + np.linalg.cholesky(v) @ rng.normal(size=(n, 20000))
    means = inverse @ x.T @ np.linalg.solve(v, z)
    stated = np.array([-1, 1]) @ inverse @ np.array([-1, 1])
    found = (means[1] - means[0] - 7.0).var()
    assert abs(found / stated - 1) < 0.05, (found, stated)
    # With the weights of another coordinate each variance is that of its own errors.
    other = np.eye(n) + 16 * np.exp(-np.abs(t[:, None] - t[None]) / 30)
    h = np.linalg.inv(x.T @ np.linalg.solve(other, x)) @ x.T @ np.linalg.inv(other)
    found, stated = np.array([-1, 1]) @ h @ z, np.array([-1, 1]) @ h @ v @ h.T @ np.array([-1, 1])
    assert abs(found.mean() - 7) < 0.1 and abs(found.var() / stated - 1) < 0.05, (found.var(), stated)
    # A swing over a day that a coordinate's noise hides: means of 48 readings contain it, the shared weights with s^2 cos do not.
    n, k = 96, 56
    t, side = np.arange(n, dtype=float), (np.arange(n) >= k).astype(float)
    swing = np.sin(2 * np.pi * t / 96)
    x = np.column_stack([1 - side, side])
    delta = t[:, None] - t[None]
    v = 0.01 * np.eye(n) + 0.5 * np.exp(-np.abs(delta) / 200) + np.cos(2 * np.pi * delta / 96)
    h = np.linalg.inv(x.T @ np.linalg.solve(v, x)) @ x.T @ np.linalg.inv(v)
    by_means, by_weights = side @ swing / side.sum() - (1 - side) @ swing / (1 - side).sum(), (h @ swing) @ np.array([-1, 1])
    assert 1 < abs(by_means) and abs(by_weights) < 0.05, (by_means, by_weights)


def check_ramp():
    """(19): the size of a ramp whose ends are fitted has the stated variance."""
    n, c, sigma = 96, 20.0, 0.4
    t, errors, stated = np.arange(n, dtype=float), [], []

    def columns(a, b):
        x = np.clip((t - a) / (b - a), 0, 1)
        within = (a < t) & (t < b)
        slopes = np.column_stack([within * (t - b), within * (a - t)]) / (b - a) ** 2
        return np.column_stack([np.ones(n), x]), slopes

    for _ in range(2000):
        z = c * np.clip((t - 24.2) / 23.9, 0, 1) + sigma * rng.normal(size=n)
        ends = np.array([24.0, 48.0])
        for _ in range(10):
            x, d = columns(*ends)
            h = np.linalg.pinv(x)
            size = (h @ z)[1]
            left = d - x @ (h @ d)
            f = size**2 * left.T @ left
            ends = ends + np.linalg.solve(f, size * left.T @ (z - x @ (h @ z)))
        x, d = columns(*ends)
        h = np.linalg.pinv(x)
        size, by_ends = (h @ z)[1], (h @ z)[1] * (h @ d)[1]
        errors.append(size - c)
        stated.append(sigma**2 * h[1] @ h[1] + sigma**2 * by_ends @ np.linalg.solve(f, by_ends))
    assert abs(np.var(errors) / np.mean(stated) - 1) < 0.1 and abs(np.mean(errors)) < 0.02, (np.var(errors), np.mean(stated))


def check_share():
    """(20): the share and the whole angle follow from the mean and the resultant length, exactly; with noise by the stated variance."""
    for s in (0.1, 0.5, 0.9, 1.0):
        for theta in (0.01, 0.2, 1.0):
            mean = s * np.exp(1j * theta) + 1 - s
            r, m = abs(mean), np.angle(mean)
            share = (1 + r * r - 2 * r * np.cos(m)) / (2 * (1 - r * np.cos(m)))
            assert abs(share - s) < 1e-9 and abs(np.angle(r * np.exp(1j * m) - 1 + s) - theta) < 1e-9
            # Half-angle quaternions: the lesser eigenvalue of their mean product is (1 - R)/2.
            q = [np.array([np.cos(a / 2), np.sin(a / 2)]) for a in (0, theta)]
            least = np.linalg.eigvalsh((1 - s) * np.outer(q[0], q[0]) + s * np.outer(q[1], q[1]))[0]
            assert abs(least - (1 - r) / 2) < 1e-12
    n, s, theta, sigma = 10, 0.6, 12.0, 0.15
    rows = (np.arange(n) < s * n) * theta + sigma * rng.normal(size=(20000, n))
    m, v = rows.mean(axis=1), rows.var(axis=1, ddof=1) * (n - 1) / n - sigma**2
    whole, true_v = m + v / m, s * (1 - s) * theta**2
    by_scatter, by_mean = np.sqrt((2 * sigma**4 + 4 * sigma**2 * true_v) / n) / m.mean(), true_v / m.mean() ** 2 * sigma / np.sqrt(n)
    assert abs(whole.mean() - theta) < 0.01 and 0.7 < whole.std() / np.hypot(by_scatter, by_mean) < 1.4, (whole.mean(), whole.std())


def check_clock():
    """(18): counts that are lost at random are called twice as many at most as often as stated; doubled ones are found."""
    n, alpha, records = 96, 0.01, 20000
    for rows, kept in ((90, 1.0), (90, 0.1), (9, 0.5)):
        rate = rows * kept
        counts = rng.binomial(rows, kept, size=(records, n))
        run, best = np.zeros(records), np.zeros(records)
        for c in counts.T:
            run = np.maximum(run, 0) + c * np.log(2) - rate
            best = np.maximum(best, run)
        assert (best > np.log(n / alpha)).mean() <= alpha, (rows, kept)


for check in (check_sums, check_chordal_mean, check_choice, check_scale, check_instant, check_prior,
              check_filter, check_evidence, check_penalty, check_size, check_clock, check_ramp, check_share):
    check()
    print(f"{check.__name__}: {check.__doc__}")
