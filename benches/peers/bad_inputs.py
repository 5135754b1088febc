"""What each library makes of 23 bad inputs: a table of C (correct pose), R (clear refusal: an error, a flag, or an answer marked as
doubtful), W (a wrong pose reported as success), N (NaN reported as success) and X (crash or hang). Each call runs in a process of its own.

The scene is 8 points of a 1 m cube seen exactly from 5 m. Resight answers through its program; its `ambiguous` and `inconsistent`
answers count as C when the right pose is among those given, as R when it is not.
"""

import argparse
import json
import multiprocessing
import subprocess
from pathlib import Path

import cv2
import numpy as np
import poselib

from scenes import CAMERA, CENTRE, F, SIZE, angle_deg, centre, project, random_rotation

try:
    import pycolmap
except ImportError:  # no wheel for this machine: its column is left out
    pycolmap = None

LIMIT_S = 20
CAMERA_DICT = {"model": "PINHOLE", "width": SIZE[0], "height": SIZE[1], "params": [F, F, *CENTRE]}


def cases():
    """(name, points, pixels, truth (R, t) or None where nothing is right)."""
    rng = np.random.default_rng(23)
    r, t = random_rotation(rng), np.array([0.2, -0.1, 5.0])
    x = rng.uniform(-0.5, 0.5, (8, 3))
    u = project(x @ r.T + t)
    truth = (r, t)

    def put(array, index, value):
        array = array.copy()
        array[index] = value
        return array

    line = np.outer(np.linspace(-0.5, 0.5, 8), [0.3, 0.9, 0.1])
    on_line = project(line @ r.T + t)
    flat = x * [1, 1, 0]
    edge_r = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)  # the camera in the plane of the points
    edge_t = np.array([0.1, 0.0, 5.0])
    behind_t = np.array([0.2, -0.1, -5.0])
    shifted = x.copy()
    shifted[3] = (np.array([0.1, 0.2, -3.0]) - t) @ r
    some_behind = project(shifted @ r.T + t)
    offset = np.array([5e6, -4e6, 3e6])
    return [
        ("n = 3", x[:3], u[:3], truth), ("n = 2", x[:2], u[:2], None), ("n = 1", x[:1], u[:1], None),
        ("n = 0", x[:0], u[:0], None), ("lengths 7 and 8", x[:7], u, None),
        ("NaN in X, n = 8", put(x, (3, 1), np.nan), u, truth), ("NaN in u, n = 8", x, put(u, (3, 0), np.nan), truth),
        ("inf in X, n = 8", put(x, (3, 1), np.inf), u, truth), ("inf in u, n = 8", x, put(u, (3, 0), np.inf), truth),
        ("NaN in X, n = 4", put(x[:4], (3, 1), np.nan), u[:4], None),
        ("duplicate point, n = 4", put(x[:4], 3, x[1]), put(u[:4], 3, u[1]), truth),
        ("same X, two pixels", put(x[:4], 3, x[1]), u[:4], None),
        ("4 identical", np.repeat(x[:1], 4, 0), np.repeat(u[:1], 4, 0), None),
        ("all zeros", np.zeros((4, 3)), np.zeros((4, 2)), None),
        ("8 rows, 3 distinct", x[[0, 1, 2, 0, 1, 2, 0, 1]], u[[0, 1, 2, 0, 1, 2, 0, 1]], truth),
        ("4 collinear", line[:4], on_line[:4], None), ("8 collinear", line, on_line, None),
        ("camera in the plane", flat, project(flat @ edge_r.T + edge_t), (edge_r, edge_t)),
        ("all behind", x, project(x @ r.T + behind_t), None), ("1 of 8 behind", shifted, some_behind, truth),
        ("scale 1e9", 1e9 * x, u, (r, 1e9 * t)), ("scale 1e-9", 1e-9 * x, u, (r, 1e-9 * t)),
        ("offset 7e6 m", x + offset, u, (r, t - r @ offset)),
    ]


def opencv(flag):
    def run(x, u):
        done, r, t = cv2.solvePnP(x, u, CAMERA, None, flags=flag)
        return (cv2.Rodrigues(r)[0], t.ravel()) if done else None

    return run


def opencv_ransac(flags):
    def run(x, u):
        done, r, t, _ = cv2.solvePnPRansac(x, u, CAMERA, None, flags=flags)
        return (cv2.Rodrigues(r)[0], t.ravel()) if done else None

    return run


def pose_lib(x, u):
    pose, _ = poselib.estimate_absolute_pose(u, x, CAMERA_DICT, {}, {})
    return np.asarray(pose.R), np.asarray(pose.t)


def colmap(x, u):
    camera = pycolmap.Camera(model="PINHOLE", width=SIZE[0], height=SIZE[1], params=[F, F, *CENTRE])
    answer = pycolmap.estimate_and_refine_absolute_pose(u, x, camera)
    if answer is None:
        return None
    matrix = answer["cam_from_world"].matrix()
    return matrix[:, :3], matrix[:, 3]


def contenders():
    rows = {f"cv {name}": opencv(getattr(cv2, f"SOLVEPNP_{name}")) for name in ("P3P", "AP3P", "ITERATIVE", "EPNP", "SQPNP", "IPPE")}
    rows |= {"cv Ransac": opencv_ransac(cv2.SOLVEPNP_ITERATIVE), "cv USAC": opencv_ransac(cv2.USAC_DEFAULT), "PoseLib": pose_lib}
    return rows | ({"pycolmap": colmap} if pycolmap else {})


def is_right(r, t, points, truth):
    """Within 0.1 degrees, and the camera's place within a thousandth of its distance from the points."""
    if truth is None:
        return False
    distance = np.linalg.norm(centre(*truth) - np.nanmean(points[np.isfinite(points).all(axis=1)], axis=0))
    return angle_deg(r, truth[0]) < 0.1 and np.linalg.norm(centre(r, t) - centre(*truth)) < 1e-3 * distance


def judged(run, case, result):
    _, x, u, truth = case
    try:
        pose = run(np.ascontiguousarray(x), np.ascontiguousarray(u))
    except Exception:  # any exception is a refusal
        result.put("R")
        return
    if pose is None:
        result.put("R")
    elif not all(np.isfinite(a).all() for a in pose):
        result.put("N")
    else:
        result.put("C" if is_right(*pose, x, truth) else "W")


def in_a_process(run, case):
    result = multiprocessing.Queue()
    child = multiprocessing.Process(target=judged, args=(run, case, result))
    child.start()
    child.join(LIMIT_S)
    if child.is_alive() or child.exitcode != 0:
        child.kill()
        return "X"
    return result.get()


def resight(program, folder, case):
    _, x, u, truth = case
    camera, points = folder / "camera.toml", folder / "bad.csv"
    size = f"width_px = {SIZE[0]}\nheight_px = {SIZE[1]}\n"
    camera.write_text(f'model = "pinhole"\n{size}fx_px = {F}\nfy_px = {F}\ncx_px = {CENTRE[0]}\ncy_px = {CENTRE[1]}\n')
    rows = ["x_m,y_m,z_m,u_px,v_px"]
    for k in range(max(len(x), len(u))):
        cells = [repr(float(c)) for a in (x, u) if k < len(a) for c in a[k]]
        rows.append(",".join(cells if k < len(x) else [""] * 3 + cells))
    points.write_text("\n".join(rows) + "\n")
    command = [program, "solve", points, "--camera", camera, "--sigma-px", "0.5", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    if done.returncode not in (0, 1, 2):
        return "X"
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    answers = [a for a in answers if a["cam_from_target"]]
    if not answers:
        return "R" if done.returncode else "W"
    poses = [answers[0]] + [o for o in [answers[0]["ambiguity"]["other"]] if o]
    matrices = [np.array(p["cam_from_target"]["matrix"], float) for p in poses]
    if any(is_right(m[:3, :3], m[:3, 3], x, truth) for m in matrices):
        return "C"
    return "W" if answers[0]["status"] == "ok" else "R"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", help="path of resight")
    parser.add_argument("--folder", type=Path, default=Path("/tmp"))
    options = parser.parse_args()
    multiprocessing.set_start_method("fork")
    rows = contenders()
    print("| input | " + " | ".join([*rows, "Resight"]) + " |\n| --- |" + " --- |" * (len(rows) + 1))
    tally = {name: "" for name in [*rows, "Resight"]}
    for case in cases():
        verdicts = {name: in_a_process(run, case) for name, run in rows.items()}
        verdicts["Resight"] = resight(options.program, options.folder, case)
        for name, verdict in verdicts.items():
            tally[name] += verdict
        print(f"| {case[0]} | " + " | ".join(verdicts.values()) + " |")
    wrong = [str(sum(v in "WNX" for v in verdicts)) for verdicts in tally.values()]
    print("| **wrong, NaN or crashed** | " + " | ".join(wrong) + " |")


if __name__ == "__main__":
    main()
