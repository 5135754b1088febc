"""The solver family, Resight against OpenCV, PoseLib and COLMAP, on the same problems in one run; prints Markdown tables.

Minimal solvers on PoseLib's own random problems (pixels in a field of 75 degrees, depths 0.1-10); refinement from a start off by
2 degrees and 2 % on points of a 4 m cube seen from 6-15 m, 1 px; the same without a start; and points 4-20 m away of which a
share is wrong, 1 px, threshold 4 px. Times are CPU times of one thread, medians over problems of the fastest of three calls;
contenders take turns. A Python call costs a few microseconds whatever it does: that cost is measured with calls that do no
work, printed, and taken off in the columns that say so.
"""

import argparse
import json
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np
import poselib

from scenes import CAMERA, CENTRE, F, SIZE, angle_deg, centre, cloud, minimal, rotation, with_outliers

try:
    import pycolmap
except ImportError:  # no wheel for this machine: its rows are left out
    pycolmap = None

ROUNDS = 3
SIGMA_PX, THRESHOLD_PX = 1.0, 4.0
CAMERA_DICT = {"model": "PINHOLE", "width": SIZE[0], "height": SIZE[1], "params": [F, F, *CENTRE]}


# ---- timing


def fastest_us(calls, problems):
    """{name: (median µs, answers)}: every call on every problem, in turns, the fastest of its rounds."""
    times = {name: np.full((ROUNDS, len(problems)), np.inf) for name in calls}
    answers = {name: [None] * len(problems) for name in calls}
    for k in range(ROUNDS):
        for name, call in calls.items():
            for i, problem in enumerate(problems):
                start = time.thread_time_ns()
                answer = call(*problem)
                times[name][k, i] = time.thread_time_ns() - start
                answers[name][i] = answer
    return {name: (np.median(times[name].min(axis=0)) / 1e3, answers[name]) for name in calls}


def clock_us():
    return fastest_us({"": lambda: None}, [()] * 2000)[""][0]


def resight(program, job, folder, records, n_points, *options):
    """Runs one job of `bench_family` on records (count, length): its JSON line and the poses it wrote, NaN where none."""
    given, answered = folder / f"{job}.f64", folder / f"{job}-answers.f64"
    np.ascontiguousarray(records, dtype="<f8").tofile(given)
    command = [program, job, given, answered, str(n_points), *map(str, options)]
    figures = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    found = np.fromfile(answered, dtype="<f8").reshape(len(records), -1, 12)
    return figures, found[..., :9].reshape(*found.shape[:2], 3, 3), found[..., 9:]


def table(heads, rows):
    print("| " + " | ".join(heads) + " |")
    print("| --- " * 2 + "|" + " ---: |" * (len(heads) - 2))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


# ---- minimal solvers


def missed(found, truth):
    """Problems none of whose answers (a list of (R, t)) is within 1e-6 of the truth, and those with one behind the camera."""
    r, t = truth
    count = 0
    for k, poses in enumerate(found):
        errors = [np.linalg.norm(a - r[k]) + np.linalg.norm(b - t[k]) / np.linalg.norm(t[k]) for a, b in poses]
        count += not any(e < 1e-6 for e in errors)
    return count


def behind(found, origins, bearings, points):
    """Share of answers with a point behind its camera."""
    total, bad = 0, 0
    for k, poses in enumerate(found):
        for r, t in poses:
            depth = np.einsum("nj,nj->n", points[k] @ np.asarray(r).T + t - origins[k], bearings[k])
            total, bad = total + 1, bad + (not (depth > 0).all())
    return 100 * bad / max(total, 1)


def poselib_minimal(call, takes_origins):
    def run(origins, bearings, points):
        return call(origins, bearings, points) if takes_origins else call(bearings, points)

    return run


def minimal_rows(options):
    jobs = [("p3p", 3, poselib.p3p, {}), ("upright_p2p", 2, poselib.up2p, {"upright": True}),
            ("gp3p", 3, poselib.gp3p, {"rig": True}), ("upright_gp2p", 2, poselib.ugp2p, {"rig": True, "upright": True})]
    nothing = [(np.full((2, 3), np.nan), np.full((2, 3), np.nan))] * 2000
    binding = fastest_us({"": poselib.up2p}, nothing)[""][0]
    print(f"A call of PoseLib's 2-point solver on points that are no numbers, clock included: {binding:.2f} µs, taken off below.\n")
    rows = []
    for job, n, call, kind in jobs:
        r, t, origins, bearings, points = minimal(options.problems, n, 7, **kind)
        problems = [tuple(np.ascontiguousarray(a) for a in p) for p in zip(origins, bearings, points)]
        takes_origins = bool(kind.get("rig"))
        us, found = fastest_us({"": poselib_minimal(call, takes_origins)}, problems)[""]
        found = [[(p.R, p.t) for p in poses] for poses in found]
        theirs = [f"{us - binding:.2f}", str(missed(found, (r, t))), f"{behind(found, origins, bearings, points):.0f} %"]
        records = np.concatenate([a.reshape(len(r), -1) for a in (origins, bearings, points)], axis=1)
        figures, our_r, our_t = resight(options.program, job, options.folder, records, n)
        ours = [[(a, b) for a, b in zip(x, y) if np.isfinite(a).all()] for x, y in zip(our_r, our_t)]
        mine = [f"{figures['median_ns'] / 1e3:.3f}", str(missed(ours, (r, t))), f"{behind(ours, origins, bearings, points):.0f} %"]
        rows += [[f"PoseLib {poselib.__version__}", call.__name__, *theirs], ["Resight", f"`{job}`", *mine]]
    table(["library", "call", "µs", f"missed of {options.problems}", "answers behind a camera"], rows)


# ---- n points


def off(r, t, seed):
    """A start 2 degrees and 2 % of the distance away."""
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    step = rng.standard_normal(3)
    turn = rotation(np.radians(2) * axis[None] / np.linalg.norm(axis))[0]
    return turn @ r, t + 0.02 * np.linalg.norm(t) * step / np.linalg.norm(step)


def rodrigues(r):
    return cv2.Rodrigues(np.ascontiguousarray(r))[0]


def start_pose(r, t):
    pose = poselib.CameraPose()
    pose.R, pose.t = r, t
    return pose


def colmap_camera():
    return pycolmap.Camera(model="PINHOLE", width=SIZE[0], height=SIZE[1], params=[F, F, *CENTRE])


def refine_calls():
    l2 = {"loss_type": "TRIVIAL"}
    return {
        ("OpenCV", "solvePnPRefineLM"): lambda x, u, r, t: cv2.solvePnPRefineLM(x, u, CAMERA, None, rodrigues(r), t.reshape(3, 1).copy()),
        ("PoseLib", "refine_absolute_pose, L2"): lambda x, u, r, t: poselib.refine_absolute_pose(u, x, start_pose(r, t), CAMERA_DICT, l2)[0],
        ("PoseLib", "refine_absolute_pose"): lambda x, u, r, t: poselib.refine_absolute_pose(u, x, start_pose(r, t), CAMERA_DICT, {})[0],
    }


def global_calls():
    def sqpnp(x, u):
        return cv2.solvePnP(x, u, CAMERA, None, flags=cv2.SOLVEPNP_SQPNP)[1:]

    def sqpnp_lm(x, u):
        return cv2.solvePnPRefineLM(x, u, CAMERA, None, *sqpnp(x, u))

    calls = {
        ("OpenCV", "solvePnP SQPNP"): sqpnp,
        ("OpenCV", "solvePnP SQPNP + RefineLM"): sqpnp_lm,
        ("PoseLib", "estimate_absolute_pose, min_iterations 10"): lambda x, u: poselib.estimate_absolute_pose(
            u, x, CAMERA_DICT, {"min_iterations": 10}, {})[0],
    }
    if pycolmap:
        camera = colmap_camera()
        calls[("pycolmap", "estimate_and_refine, with covariance")] = lambda x, u: pycolmap.estimate_and_refine_absolute_pose(
            u, x, camera, return_covariance=True)
    return calls


def unpacked(answer):
    if answer is None:
        return np.full((3, 3), np.nan), np.full(3, np.nan)
    if hasattr(answer, "R"):
        return np.asarray(answer.R), np.asarray(answer.t)
    if isinstance(answer, dict):
        matrix = answer["cam_from_world"].matrix()
        return matrix[:, :3], matrix[:, 3]
    return cv2.Rodrigues(np.asarray(answer[0]))[0], np.asarray(answer[1]).ravel()


def rms_deg(answers, truth):
    r = np.array([unpacked(a)[0] for a in answers])
    errors = angle_deg(r, truth)
    errors = errors[errors < 5]  # a wrong minimum is not inaccuracy; it is counted apart
    return np.sqrt(np.mean(errors**2)) if len(errors) else np.nan, len(answers) - len(errors)


def n_point_rows(options, title, with_start, calls):
    versions = {"OpenCV": cv2.__version__, "PoseLib": poselib.__version__, "pycolmap": pycolmap and pycolmap.__version__}
    figures = {name: [] for name in [*calls, ("Resight", "`refine`" if with_start else "`locate`")]}
    for n in (10, 100, 1000):
        count = max(20, options.problems // (20 * max(1, n // 10)))
        r, t, points, pixels = cloud(count, n, SIGMA_PX, 11 + n)
        starts = [off(a, b, k) for k, (a, b) in enumerate(zip(r, t))]
        extra = starts if with_start else [()] * count
        problems = [(np.ascontiguousarray(x), np.ascontiguousarray(u), *s) for x, u, s in zip(points, pixels, extra)]
        found = fastest_us(calls, problems)
        flat = np.concatenate([points, pixels], axis=2).reshape(count, -1)
        start = np.array([np.concatenate([a.ravel(), b]) for a, b in starts])
        job = "refine" if with_start else "locate"
        ours, our_r, _ = resight(options.program, job, options.folder, np.hstack([start, flat]), n, SIGMA_PX)
        for name, (us, answers) in found.items():
            figures[name].append((us, *rms_deg(answers, r)))
        errors = angle_deg(our_r[:, 0], r)
        kept = errors[errors < 5]
        figures[("Resight", f"`{job}`")].append((ours["median_ns"] / 1e3, np.sqrt(np.mean(kept**2)), count - len(kept)))
    best = [row[1] for row in figures[("Resight", "`refine`" if with_start else "`locate`")]]
    rows = []
    for (library, call), cells in figures.items():
        version = versions.get(library)
        text = [f"{us:.1f} µs, {rms / b:.3f}" + (f", {wrong} wrong" if wrong else "") for (us, rms, wrong), b in zip(cells, best)]
        rows.append([f"{library} {version}" if version else library, call, *text])
    print(f"{title}: time and error of rotation as a multiple of Resight's.\n")
    table(["library", "call", "n = 10", "n = 100", "n = 1000"], rows)


# ---- wrong correspondences


def robust_calls():
    def usac(flag):
        def run(x, u):
            done, r, t, _ = cv2.solvePnPRansac(
                x, u, CAMERA, None, iterationsCount=10000, reprojectionError=THRESHOLD_PX, confidence=0.9999, flags=flag)
            return (r, t) if done else None

        return run

    ransac = {"max_reproj_error": THRESHOLD_PX}
    calls = {
        ("OpenCV", "solvePnPRansac USAC_FAST"): usac(cv2.USAC_FAST),
        ("OpenCV", "solvePnPRansac USAC_MAGSAC"): usac(cv2.USAC_MAGSAC),
        ("PoseLib", "estimate_absolute_pose"): lambda x, u: poselib.estimate_absolute_pose(u, x, CAMERA_DICT, ransac, {})[0],
        ("PoseLib", "the same, min_iterations 50"): lambda x, u: poselib.estimate_absolute_pose(
            u, x, CAMERA_DICT, {**ransac, "min_iterations": 50}, {})[0],
    }
    if pycolmap:
        camera = colmap_camera()
        options = {"ransac": {"max_error": THRESHOLD_PX}}
        calls[("pycolmap", "estimate_and_refine_absolute_pose")] = lambda x, u: pycolmap.estimate_and_refine_absolute_pose(
            u, x, camera, options)
    return calls


def robust_rows(options):
    calls = robust_calls()
    names = [*calls, ("Resight", "`consensus`"), ("", "maximum likelihood on the right points")]
    cells = {name: [] for name in names}
    for share in (0.5, 0.8, 0.9):
        count, n = options.robust, 1000
        r, t, points, pixels, good = with_outliers(count, n, share, SIGMA_PX, 3 + round(100 * share))
        problems = [(np.ascontiguousarray(x), np.ascontiguousarray(u)) for x, u in zip(points, pixels)]
        skip = [name for name in calls if share == 0.9 and name[0] == "pycolmap"]  # most of a minute each
        found = fastest_us({k: c for k, c in calls.items() if k not in skip}, problems)
        for name, (us, answers) in found.items():
            poses = [unpacked(a) for a in answers]
            cells[name].append(robust_cell(us, np.array([p[0] for p in poses]), np.array([p[1] for p in poses]), r, t))
        for name in skip:
            cells[name].append("–")
        flat = np.concatenate([points, pixels], axis=2)
        start = np.hstack([r.reshape(count, 9), t])
        ours, our_r, our_t = resight(
            options.program, "robust", options.folder, np.hstack([start, flat.reshape(count, -1)]), n, SIGMA_PX, THRESHOLD_PX)
        cells[names[-2]].append(robust_cell(ours["median_ns"] / 1e3, our_r[:, 0], our_t[:, 0], r, t))
        right = np.array([f[g] for f, g in zip(flat, good)])
        _, ml_r, ml_t = resight(
            options.program, "refine", options.folder, np.hstack([start, right.reshape(count, -1)]), right.shape[1], SIGMA_PX)
        cells[names[-1]].append(robust_cell(None, ml_r[:, 0], ml_t[:, 0], r, t))
    rows = [[*name, *found] for name, found in cells.items()]
    print("1000 points, 1 px, threshold 4 px: time, success (< 1°, < 0.2 m), median errors of rotation and place.\n")
    table(["library", "call", "50 % wrong", "80 % wrong", "90 % wrong"], rows)


def robust_cell(us, r, t, true_r, true_t):
    with np.errstate(invalid="ignore"):
        degrees, metres = angle_deg(r, true_r), np.linalg.norm(centre(r, t) - centre(true_r, true_t), axis=1)
        good = (degrees < 1) & (metres < 0.2)
    text = f"{100 * np.mean(good):.0f} %, {np.median(degrees[good]):.4f}° {1e3 * np.median(metres[good]):.2f} mm" if good.any() else "0 %"
    return text if us is None else f"{us / 1e3:.2f} ms, {text}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", help="path of the example bench_family")
    parser.add_argument("--folder", type=Path, default=Path("/tmp"))
    parser.add_argument("--problems", type=int, default=20000)
    parser.add_argument("--robust", type=int, default=30)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    if pycolmap:
        pycolmap.set_random_seed(0)
    print(f"Times include {clock_us():.2f} µs of the clock in Python's rows.\n")
    minimal_rows(options)
    n_point_rows(options, "From a start off by 2° and 2 %", True, refine_calls())
    n_point_rows(options, "Without a start", False, global_calls())
    robust_rows(options)


if __name__ == "__main__":
    main()
