"""Rigs with known truth for `rig.py`: cameras in an arc around a volume, a board moved through it; the seed of each is fixed."""

import numpy as np

from scenes import rotation

DISTORTION = np.array([-0.21, 0.08, 0.0004, -0.0003, -0.01])  # Brown: k1 k2 p1 p2 k3
SIZE = (1600, 1200)


def grid(columns, rows, spacing_m):
    """Corners of a board, row by row, z = 0: (rows · columns, 3)."""
    x, y = np.meshgrid(np.arange(columns) * spacing_m, np.arange(rows) * spacing_m)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1)


def wang():
    """The paper's layout: three points on a line, a fourth beside its end; metres, the target of `four_points.py`."""
    return np.array([[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 1.0, 0]])


def project(camera, x):
    """Pixels (n, 2) of points in the camera's frame; NaN where they lie behind or beyond the lens's one-to-one field."""
    a = x[:, :2] / x[:, 2:]
    r2 = (a * a).sum(1)
    k1, k2, p1, p2, k3 = camera["distortion"]
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = a[:, 0] * radial + 2 * p1 * a[:, 0] * a[:, 1] + p2 * (r2 + 2 * a[:, 0] ** 2)
    v = a[:, 1] * radial + p1 * (r2 + 2 * a[:, 1] ** 2) + 2 * p2 * a[:, 0] * a[:, 1]
    fx, fy, cx, cy = camera["matrix"]
    seen = np.stack([fx * u + cx, fy * v + cy], 1)
    outside = (x[:, 2] < 0.05) | (1.0 < r2) | (seen < -0.5).any(1) | (np.array(camera["size"]) - 0.5 < seen).any(1)
    seen[outside] = np.nan
    return seen


def look_at(place, towards):
    """cam_from_world of a camera at `place` that looks at `towards`, its y axis downwards (world z up)."""
    z = (towards - place) / np.linalg.norm(towards - place)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    r = np.stack([x, np.cross(z, x), z])
    return r, -r @ place


def rig(n_cameras, n_views, board, noise_px, seed, reach_m=2.2, spread_m=1.0, focal_px=1100.0, distorted=True):
    """Cameras (with cam_from_rig = (R, t), rig = camera 0), views (rig_from_target) and pixels (view, camera, point, 2), NaN unseen."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-0.6, 0.6, n_cameras) if 1 < n_cameras else np.zeros(1)
    world = []
    for angle in angles:
        place = reach_m * np.array([np.sin(angle), -np.cos(angle), 0.15]) + 0.05 * rng.standard_normal(3)
        world.append(look_at(place, 0.05 * rng.standard_normal(3)))
    r0, t0 = world[0]
    cameras = []
    for r, t in world:
        matrix = focal_px + rng.uniform(-20, 20), focal_px + rng.uniform(-20, 20), 799.5 + rng.uniform(-9, 9), 599.5 + rng.uniform(-9, 9)
        distortion = DISTORTION * rng.uniform(0.8, 1.2, 5) if distorted else np.zeros(5)
        cameras.append({"size": SIZE, "matrix": matrix, "distortion": distortion, "r": r @ r0.T, "t": t - r @ r0.T @ t0})
    middle = board.mean(0)
    views, pixels = [], np.full((n_views, n_cameras, len(board), 2), np.nan)
    for view in range(n_views):
        turn = rotation(np.array([rng.uniform(-0.7, 0.7, 3)]))[0]
        facing = np.array([[1, 0, 0], [0, 0, 1.0], [0, -1, 0]])  # board's z away from the cameras, y downwards
        r = r0 @ turn @ facing
        t = r0 @ (spread_m * np.array([0.45, 0.35, 0.3]) * rng.uniform(-1, 1, 3)) + t0 - r @ middle
        views.append((r, t))
        for c, camera in enumerate(cameras):
            x = (board @ r.T + t) @ camera["r"].T + camera["t"]
            pixels[view, c] = project(camera, x) + noise_px * rng.standard_normal((len(board), 2))
    return cameras, views, pixels


def write(path, cameras, board, pixels, sigma_px):
    """The file of `bench_rig`: `c` rows are cameras, `s` rows points."""
    with open(path, "w") as file:
        print("sigma_px", sigma_px, sep=",", file=file)
        for camera in cameras:
            print("c", *camera["size"], *camera["matrix"], *camera["distortion"], sep=",", file=file)
        for view, of_view in enumerate(pixels):
            for c, of_camera in enumerate(of_view):
                for x, seen in zip(board, of_camera):
                    if not np.isnan(seen[0]):
                        print("s", c, view, *x, repr(float(seen[0])), repr(float(seen[1])), sep=",", file=file)
