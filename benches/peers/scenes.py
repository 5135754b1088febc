"""Random problems of the comparisons, and how a pose is judged; the seed of each is fixed."""

import numpy as np

SIZE, F = (1280, 960), 1000.0
CENTRE = np.array([639.5, 479.5])
CAMERA = np.array([[F, 0, CENTRE[0]], [0, F, CENTRE[1]], [0, 0, 1]])


def cross(v):
    """Matrices (…, 3, 3) with cross(v) @ x = v × x."""
    zero = np.zeros_like(v[..., 0])
    rows = [zero, -v[..., 2], v[..., 1], v[..., 2], zero, -v[..., 0], -v[..., 1], v[..., 0], zero]
    return np.stack(rows, -1).reshape(*v.shape[:-1], 3, 3)


def rotation(vectors):
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3), radians."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    k = cross(vectors)
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (k @ k)


def random_rotation(rng):
    q = rng.standard_normal(4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def project(x_in_cam):
    return F * x_in_cam[..., :2] / x_in_cam[..., 2:] + CENTRE


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def minimal(count, n_points, seed, upright=False, rig=False):
    """Exact minimal problems as PoseLib draws them: pixels in a field of 75°, depths 0.1–10. Returns rotation, translation,
    origins of the rays (zero without `rig`), bearings, points (count, n, 3)."""
    rng = np.random.default_rng(seed)
    half = np.tan(np.radians(75 / 2))
    bearings = unit(np.dstack([rng.uniform(-half, half, (count, n_points, 2)), np.ones((count, n_points))]))
    depths = rng.uniform(0.1, 10, (count, n_points, 1))
    if upright:
        angle, zero = rng.uniform(-np.pi, np.pi, count), np.zeros(count)
        r = rotation(np.stack([zero, angle, zero], 1))
    else:
        r = np.array([random_rotation(rng) for _ in range(count)])
    t = rng.standard_normal((count, 3))
    origins = rng.standard_normal((count, n_points, 3)) if rig else np.zeros((count, n_points, 3))
    x_in_cam = origins + depths * bearings
    points = np.einsum("nij,nki->nkj", r, x_in_cam - t[:, None])
    return r, t, origins, bearings, points


def cloud(count, n_points, noise_px, seed, depths_m=(6.0, 15.0)):
    """Points of a 4 m cube seen from 6–15 m (or each point at its own depth in a picture when n is large and `depths_m`
    spans the scene): truth (R, t), points (count, n, 3), pixels (count, n, 2)."""
    rng = np.random.default_rng(seed)
    rs, ts, points, pixels = [], [], [], []
    while len(rs) < count:
        x = rng.uniform(-2, 2, (n_points, 3))
        r = random_rotation(rng)
        t = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(*depths_m)])
        in_cam = x @ r.T + t
        seen = project(in_cam)
        if (in_cam[:, 2] > 1).all():
            rs.append(r), ts.append(t), points.append(x), pixels.append(seen + noise_px * rng.standard_normal(seen.shape))
    return np.array(rs), np.array(ts), np.array(points), np.array(pixels)


def with_outliers(count, n_points, share, noise_px, seed):
    """Points 4–20 m before the camera, anywhere in the picture; a share of the pixels is anywhere else."""
    rng = np.random.default_rng(seed)
    rs, ts, points, pixels, good = [], [], [], [], []
    for _ in range(count):
        seen = rng.uniform([0, 0], SIZE, (n_points, 2))
        in_cam = np.column_stack([(seen - CENTRE) / F, np.ones(n_points)]) * rng.uniform(4, 20, (n_points, 1))
        r, t = random_rotation(rng), rng.uniform(-5, 5, 3)
        is_good = np.arange(n_points) >= round(share * n_points)
        rng.shuffle(is_good)
        noisy = seen + noise_px * rng.standard_normal(seen.shape)
        wrong = rng.uniform([0, 0], SIZE, (n_points, 2))
        rs.append(r), ts.append(t), points.append((in_cam - t) @ r), good.append(is_good)
        pixels.append(np.where(is_good[:, None], noisy, wrong))
    return np.array(rs), np.array(ts), np.array(points), np.array(pixels), np.array(good)


def angle_deg(r, truth):
    """Angle between rotations, degrees, exact for small ones."""
    chord = np.linalg.norm(r - truth, axis=(-2, -1)) / np.sqrt(8)
    return np.degrees(2 * np.arcsin(np.clip(chord, 0, 1)))


def centre(r, t):
    return -np.einsum("...ij,...i->...j", r, t)
