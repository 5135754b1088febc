"""Proves equations (1)-(8) of fleet.md: exact sums, chordal means, bottom-k choices, the robust scale.

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


for check in (check_sums, check_chordal_mean, check_choice, check_scale, check_instant):
    check()
    print(f"{check.__name__}: {check.__doc__}")
