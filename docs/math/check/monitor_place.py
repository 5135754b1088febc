"""docs/math/monitor.md section 12: eqs. (110)-(112)."""

import numpy as np

rng = np.random.default_rng(12)
points, runs = 12, 4000
focal, distance = 800.0, 1.2
x = np.array([[0.1 * (i % 4) - 0.15, 0.1 * (i // 4) - 0.1, distance + 0.3 * (0.1 * (i % 4) - 0.15)] for i in range(points)])


def derivative(p):
    by_point = np.array([[focal / p[2], 0, -focal * p[0] / p[2] ** 2], [0, focal / p[2], -focal * p[1] / p[2] ** 2]])
    cross = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
    return np.hstack([-by_point @ cross, by_point])


j = np.vstack([derivative(p) for p in x])
stated = np.repeat(rng.uniform(0.017, 0.023, points), 2)
lens = 0.16
w = 1 / np.sqrt(stated**2 + lens**2)
normal = j.T @ (j * w[:, None] ** 2)
gain = np.linalg.solve(normal, j.T * w**2)

# (111): a pose found with the weights of both errs by the image alone.
inner = j.T @ (j * (w**4 * stated**2)[:, None])
by_image = np.linalg.solve(normal, np.linalg.solve(normal, inner).T)
errors = rng.normal(0, 1, (100000, 2 * points)) * stated
poses = errors @ gain.T
root = np.linalg.cholesky(by_image)
whitened = np.linalg.solve(root, poses.T)
assert np.allclose(whitened @ whitened.T / len(poses), np.eye(6), atol=0.02)

# (110) and (112), which is exact for corners that are stated alike: shares of the stated variance that stay and that
# scatter, n images before and m after; the lens cancels.
stays, scatters, n, m = 0.3, 0.5, 200, 20
residual = np.eye(2 * points) - j @ gain
share, motions = [], []
for _ in range(runs):
    of_lens = rng.normal(0, lens, 2 * points)
    means, variances = [], []
    for images in (n, m):
        place = rng.normal(0, 1, 2 * points) * stated * np.sqrt(stays)
        mean = rng.normal(0, 1, 2 * points) * stated * np.sqrt(scatters / images)
        means.append(of_lens + place + mean)
        # s_k^2 on the average: the residuals of what scatters.
        variances.append(np.diag(residual @ np.diag(scatters * stated**2) @ residual.T) / stated**2)
    r = [residual @ mean / stated for mean in means]
    share.append((0.5 * (r[1] - r[0]) ** 2 - 0.5 * variances[0] / n - 0.5 * variances[1] / m).sum() / (2 * points - 6))
    motions.append(gain @ (means[1] - means[0]))
assert abs(np.mean(share) / stays - 1) < 0.03, np.mean(share)
expected = by_image * (2 * stays + scatters / n + scatters / m)
whitened = np.linalg.solve(np.linalg.cholesky(expected), np.array(motions).T)
assert abs((whitened**2).sum(axis=0).mean() / 6 - 1) < 0.05

# A tag's four corners leave two degrees of freedom: with what is presumed, four, no share is far too small.
share = rng.chisquare(2, 100000) / 2 * stays
estimate = (4 * stays + 2 * share) / 6
assert 6 * np.mean(stays / estimate) < 9
