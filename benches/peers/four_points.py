"""Four points to a pose, Resight against OpenCV, SciPy, PoseLib and COLMAP, all called from Python on the same points in one run; prints a
Markdown table.

The scenes: a target of three points on a line (0, 0.5 and 1 m) and a fourth 1 m beside the line's first end, seen by a
1280 x 960 camera with f = 1000 px, its middle anywhere in the picture, all four points inside. The attitude is random: turned
about the line of sight, tilted by 0-75 degrees in any direction, either face forward. A cell is a range of distances and a
noise; the seed is fixed. A contender fails where its rotation is off by more than 5 degrees or its translation by more than a
tenth of the distance, or where it gives no answer.
"""

import argparse
import statistics
import time

import cv2
import numpy as np
import poselib
import scipy
from scipy.optimize import least_squares

import resight
from scenes import CAMERA, CENTRE, F, SIZE, cross, rotation

try:
    import pycolmap
except ImportError:  # no wheel for this machine: its row is left out
    pycolmap = None

POINTS = np.array([[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 1, 0]])
FOURTH_IS_THIRD = [0, 1, 3, 2]  # OpenCV's P3P solves from the first three points given
RANGES_M, NOISES_PX = [(1.0, 3.0), (5.0, 20.0)], [0.0, 0.1, 0.5, 1.0]
TIMED = (RANGES_M[0], 0.5)
SEED, ROUNDS = 20041, 3


# ---- scenes and truth


def attitude(rng, sight):
    """A target's rotation: tilted by 0-75 degrees against the line of sight, either face forward."""
    tilt, towards, turn = rng.uniform(0, np.radians(75)), *rng.uniform(0, 2 * np.pi, 2)
    face = np.pi * rng.integers(2)
    z = np.array([0.0, 0.0, 1.0])
    axis = np.cross(z, sight)
    to_sight = np.arctan2(np.linalg.norm(axis), sight[2]) * axis / max(np.linalg.norm(axis), 1e-12)
    steps = [to_sight, tilt * np.array([np.cos(towards), np.sin(towards), 0]), [face, 0, 0], turn * z]
    return np.linalg.multi_dot(rotation(np.array(steps)))


def scenes(range_m, noise_px, count):
    """Poses (R, t) and pixels (count, 4, 2), the same geometry for every noise."""
    rng, noise = np.random.default_rng(SEED), np.random.default_rng(SEED + 1)
    rs, ts, pixels = [], [], []
    while len(rs) < count:
        distance_m, middle_px = rng.uniform(*range_m), rng.uniform([0, 0], SIZE)
        sight = np.append((middle_px - CENTRE) / F, 1.0)
        sight /= np.linalg.norm(sight)
        r = attitude(rng, sight)
        t = distance_m * sight - r @ POINTS.mean(axis=0)
        x = POINTS @ r.T + t
        seen = F * x[:, :2] / x[:, 2:] + CENTRE
        if (x[:, 2] > 0.1).all() and (seen > 0).all() and (seen < np.array(SIZE) - 1).all():
            rs.append(r), ts.append(t), pixels.append(seen)
    return np.array(rs), np.array(ts), np.array(pixels) + noise_px * noise.standard_normal((count, 4, 2))


def wrong(r, t, truth):
    """Which of these poses (n; NaN where there is none) fail."""
    with np.errstate(all="ignore"):
        cosine = (np.einsum("nij,nij->n", r, truth[0]) - 1) / 2
        shift = np.linalg.norm(t - truth[1], axis=1) / np.linalg.norm(truth[1], axis=1)
        return ~((cosine >= np.cos(np.radians(5))) & (shift <= 0.1))


# ---- the pose of least residual, whatever found it


def residuals(r, t, pixels):
    """Residuals (n, 8) px and their derivatives (n, 8, 6) by a small motion [rotation; translation] on the left."""
    x = POINTS @ r.transpose(0, 2, 1) + t[:, None]
    z = x[..., 2:]
    d = np.zeros((*x.shape[:2], 2, 3))
    d[..., 0, 0] = d[..., 1, 1] = F / z[..., 0]
    d[..., 2] = -F * x[..., :2] / z**2
    e = F * x[..., :2] / z + CENTRE - pixels
    j = np.concatenate([-d @ cross(x), d], axis=-1)
    e = np.where((z > 0).all(axis=(1, 2))[:, None, None], e, np.inf)
    return e.reshape(len(r), 8), j.reshape(len(r), 8, 6)


def refined(r, t, pixels, steps=60):
    """Levenberg-Marquardt on all poses at once; returns poses and sums of squared residuals (inf where there is none)."""
    damping = np.full(len(r), 1e-3)
    e, j = residuals(r, t, pixels)
    cost = np.einsum("ni,ni->n", e, e)
    for _ in range(steps):
        a = np.einsum("nki,nkj->nij", j, j)
        a += damping[:, None, None] * a * np.eye(6) + 1e-12 * np.trace(a, axis1=1, axis2=2)[:, None, None] * np.eye(6)
        step = -np.linalg.solve(a, np.einsum("nki,nk->ni", j, e)[..., None])[..., 0]
        turn = rotation(step[:, :3])
        trial = turn @ r, np.einsum("nij,nj->ni", turn, t) + step[:, 3:]
        e1, j1 = residuals(*trial, pixels)
        cost1 = np.einsum("ni,ni->n", e1, e1)
        better = cost1 < cost
        r, t = np.where(better[:, None, None], trial[0], r), np.where(better[:, None], trial[1], t)
        e, j, cost = np.where(better[:, None], e1, e), np.where(better[:, None, None], j1, j), np.minimum(cost, cost1)
        damping = np.where(better, damping / 10, damping * 10).clip(1e-12, 1e12)
    return r, t, cost


def least_residual(starts, pixels):
    """Of the minima reached from all `starts` (a list of poses (R, t)), the lowest in each scene."""
    best_r, best_t = (np.array(a) for a in starts[0])
    best = np.full(len(pixels), np.inf)
    for r, t in starts:
        with np.errstate(all="ignore"):
            usable = np.isfinite(r).all(axis=(1, 2)) & np.isfinite(t).all(axis=1)
            usable[usable] = np.isfinite(residuals(r[usable], t[usable], pixels[usable])[0]).all(axis=1)
            r1, t1, cost = refined(r[usable], t[usable], pixels[usable])
        lower = cost < best[usable]
        i = np.flatnonzero(usable)[lower]
        best_r[i], best_t[i], best[i] = r1[lower], t1[lower], cost[lower]
    return best_r, best_t


# ---- the contenders: pixels (4, 2) to (R, t) or None


def opencv(flag, order=(0, 1, 2, 3)):
    points, order = np.ascontiguousarray(POINTS[list(order)]), list(order)

    def run(pixels):
        try:
            found, r, t = cv2.solvePnP(points, pixels, CAMERA, None, flags=flag)
        except cv2.error:
            return None
        return (r, t) if found else None

    return run, (lambda pixels: pixels[order].copy()), (lambda a: (cv2.Rodrigues(a[0])[0], a[1].ravel()))


def pose_lib(options):
    camera = {"model": "PINHOLE", "width": SIZE[0], "height": SIZE[1], "params": [F, F, *CENTRE]}

    def run(pixels):
        return poselib.estimate_absolute_pose(pixels, POINTS, camera, options, {})[0]

    return run, np.copy, (lambda pose: (pose.R, pose.t))


def colmap():
    camera = pycolmap.Camera(model="PINHOLE", width=SIZE[0], height=SIZE[1], params=[F, F, *CENTRE])

    def run(pixels):
        return pycolmap.estimate_and_refine_absolute_pose(pixels, POINTS, camera)

    def unpack(answer):
        matrix = answer["cam_from_world"].matrix()
        return matrix[:, :3], matrix[:, 3]

    return run, np.copy, unpack


def from_sqpnp(refine):
    """OpenCV's SQPNP, then `refine(pixels, rvec, tvec)`."""

    def run(pixels):
        found, r, t = cv2.solvePnP(POINTS, pixels, CAMERA, None, flags=cv2.SOLVEPNP_SQPNP)
        return refine(pixels, r, t) if found else None

    return run, np.copy, (lambda a: (cv2.Rodrigues(a[0])[0], np.ravel(a[1])))


def refine_lm(pixels, r, t):
    return cv2.solvePnPRefineLM(POINTS, pixels, CAMERA, None, r, t)


def scipy_least_squares(pixels, r, t):
    """Residuals and derivatives by OpenCV, MINPACK's Levenberg-Marquardt: as fast as SciPy gets it."""
    seen = pixels.ravel()
    project = lambda x: cv2.projectPoints(POINTS, x[:3], x[3:], CAMERA, None)
    found = least_squares(lambda x: project(x)[0].ravel() - seen, np.concatenate([r, t]).ravel(), lambda x: project(x)[1][:, :6], "lm")
    return found.x[:3], found.x[3:]


LENS = resight.Camera("pinhole", width_px=SIZE[0], height_px=SIZE[1], fx_px=F, fy_px=F, cx_px=CENTRE[0], cy_px=CENTRE[1])
NONE = np.full((3, 3), np.nan), np.full(3, np.nan)


def matrix_of(pose):
    return NONE if pose is None else (pose.rotation, pose.translation_m)


def ours(sigma_px):
    return (lambda pixels: resight.solve(POINTS, pixels, LENS, sigma_px=sigma_px)), np.copy, (lambda a: matrix_of(a.cam_from_target))


def contenders():
    """(library and version, call, its three functions)."""
    cv, pl = f"OpenCV {cv2.__version__}", f"PoseLib {poselib.__version__}"
    rows = [(cv, f"solvePnP {name}", opencv(getattr(cv2, f"SOLVEPNP_{name}"))) for name in ("P3P", "AP3P")]
    for name in ("P3P", "AP3P"):
        call = f"solvePnP {name}, fourth point given third"
        rows.append((cv, call, opencv(getattr(cv2, f"SOLVEPNP_{name}"), FOURTH_IS_THIRD)))
    for name in ("ITERATIVE", "EPNP", "IPPE", "SQPNP"):
        rows.append((cv, f"solvePnP {name}", opencv(getattr(cv2, f"SOLVEPNP_{name}"))))
    rows.append((cv, "SQPNP, then solvePnPRefineLM", from_sqpnp(refine_lm)))
    rows.append((f"SciPy {scipy.__version__}", "least_squares, from the same SQPNP", from_sqpnp(scipy_least_squares)))
    rows.append((pl, "estimate_absolute_pose", pose_lib({})))
    rows.append((pl, "estimate_absolute_pose, min_iterations 10", pose_lib({"min_iterations": 10})))
    if pycolmap:
        rows.append((f"pycolmap {pycolmap.__version__}", "estimate_and_refine_absolute_pose", colmap()))
    return rows


def answers(contender, pixels):
    """Poses (R, t), NaN where there is none, and the thread's CPU nanoseconds of each call."""
    run, prepare, unpack = contender
    r, t = np.full((len(pixels), 3, 3), np.nan), np.full((len(pixels), 3), np.nan)
    times_ns = np.zeros(len(pixels))
    for k, seen in enumerate(map(prepare, pixels)):
        start = time.thread_time_ns()
        answer = run(seen)
        times_ns[k] = time.thread_time_ns() - start
        if answer is not None:
            r[k], t[k] = unpack(answer)
    return (r, t), times_ns


def binding_us():
    """What merely calling costs, clock included: the same arguments through each binding, and no work behind it."""
    seen, camera = np.zeros((4, 2)), {"model": "PINHOLE", "width": SIZE[0], "height": SIZE[1], "params": [F, F, *CENTRE]}
    none = np.zeros((0, 2)), np.zeros((0, 3))
    calls = {"OpenCV (norm of the points)": lambda: cv2.norm(POINTS)}
    calls["Resight (no points)"] = lambda: resight.solve(none[1], none[0], LENS)
    calls["PoseLib (no points)"] = lambda: poselib.estimate_absolute_pose(*none, camera, {}, {})
    if pycolmap:
        model = pycolmap.Camera(model="PINHOLE", width=SIZE[0], height=SIZE[1], params=[F, F, *CENTRE])
        calls["pycolmap (one point)"] = lambda: pycolmap.estimate_and_refine_absolute_pose(seen[:1], POINTS[:1], model)
    found = {}
    for name, call in calls.items():
        times = []
        for _ in range(500):
            start = time.thread_time_ns()
            call()
            times.append(time.thread_time_ns() - start)
        found[name] = statistics.median(times) / 1e3
    return found


# ---- the table


def percent(part, of=None):
    share = np.mean(part) if of is None else np.sum(part & of) / max(np.sum(of), 1)
    return f"{100 * share:.1f}"


def cell(rows, range_m, noise_px, count):
    """One column: a percentage for each line of the table."""
    *truth, pixels = scenes(range_m, noise_px, count)
    found = [answers(functions, pixels)[0] for _, _, functions in rows]
    run = ours(max(noise_px, 0.1))[0]
    told = [run(seen) for seen in pixels]
    status = np.array([answer.status for answer in told])
    first, other = (stacked([getattr(answer, name) for answer in told]) for name in ("cam_from_target", "other_cam_from_target"))
    best = least_residual([truth, *found, first, other], pixels)
    bad, second_bad = wrong(*first, truth), wrong(*other, truth)
    column = [percent(wrong(*best, truth))] + [percent(wrong(*pose, truth)) for pose in [*found, first]]
    return column + [percent(status == "ambiguous"), percent(bad, of=status == "ok"), percent(bad & second_bad)]


def stacked(poses):
    rotations, translations = zip(*map(matrix_of, poses))
    return np.array(rotations), np.array(translations)


def times_us(rows, count):
    """Median over scenes of each scene's fastest call, contenders in turns; ours last."""
    range_m, noise_px = TIMED
    pixels = scenes(range_m, noise_px, count)[2]
    all_rows = [functions for _, _, functions in rows] + [ours(noise_px)]
    rounds = [[answers(functions, pixels)[1] for functions in all_rows] for _ in range(ROUNDS)]
    return [np.median(np.min(t, axis=0)) / 1e3 for t in zip(*rounds)]


def print_table(cells, count):
    cv2.setNumThreads(1)
    if pycolmap:
        pycolmap.set_random_seed(0)
    rows = contenders()
    times = times_us(rows, count)
    columns = [cell(rows, *c, count) for c in cells]
    labels = [("", "the pose of least residual", "")]
    named = [*rows, (f"Resight {resight.__version__}", "solve", None)]
    labels += [(library, call, f"{us:.1f}") for (library, call, _), us in zip(named, times)]
    labels += [("", text, "") for text in ("says ambiguous", "fails among its `ok`", "neither of its poses is right")]
    print(f"Fails in % of {count} scenes; µs of one thread, call included, at {TIMED[0][0]:.0f}-{TIMED[0][1]:.0f} m, {TIMED[1]} px.\n")
    heads = [f"{r[0]:.0f}-{r[1]:.0f} m, {n:g} px" for r, n in cells]
    print("| " + " | ".join(["library", "call", "µs", *heads]) + " |")
    print("| --- | --- |" + " ---: |" * (1 + len(cells)))
    for k, label in enumerate(labels):
        print("| " + " | ".join([*label, *(c[k] for c in columns)]) + " |")
    overheads = ", ".join(f"{name} {us:.1f} µs" for name, us in binding_us().items())
    print(f"\nIncluded in the times, the cost of a call that does no work: {overheads}.")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", help="not used")
    parser.add_argument("--scenes", type=int, default=1000)
    print_table([(r, n) for r in RANGES_M for n in NOISES_PX], parser.parse_args().scenes)


if __name__ == "__main__":
    main()
