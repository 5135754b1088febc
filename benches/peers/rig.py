"""Relative extrinsics of several cameras, intrinsics known: Resight against mrcal and OpenCV on the same corners, in one run.

Two tables. (1) Many cameras: 8 cameras, 100 views of a board of 10 × 10 corners, 70,000 of them seen, 0.3 px; mrcal from a start 1 degree and 20 mm off and
again from its own optimum (every intrinsic fixed, no regularisation), Resight from nothing, its covariances included. Once each as the plain
maximum-likelihood problem, once each looking for wrong points. (2) Two cameras, 50 views, 0.5 px: the paper's own four-point target
and a board of 48 points, against OpenCV's stereoCalibrate with fixed intrinsics and against the mean of single poses. Errors are those of
the second camera's pose, against the truth: root mean square over the trials.
"""

import argparse
import json
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np

import rig_scenes as scenes
from scenes import rotation

MANY = dict(n_cameras=8, n_views=100, noise_px=0.3, seed=8, reach_m=1.5, spread_m=1.6, focal_px=1450.0)
SPACING_M, ROWS, COLUMNS = 0.06, 10, 10
PAIR = dict(n_cameras=2, n_views=50, noise_px=0.5, reach_m=2.2, spread_m=1.5, focal_px=1000.0, distorted=False)


def rotation_vector(r):
    return cv2.Rodrigues(np.asarray(r, float))[0].ravel()


def errors(r, t, camera):
    """Degrees and millimetres between a pose and the truth."""
    turn = rotation_vector(np.asarray(r) @ camera["r"].T)
    return np.degrees(np.linalg.norm(turn)), 1e3 * np.linalg.norm(np.asarray(t).ravel() - camera["t"])


def resight(program, path, rounds, *loss):
    return json.loads(subprocess.run([program, str(path), str(rounds), *loss], check=True, capture_output=True, text=True).stdout)


# ---- many cameras


def mrcal(folder, cameras, views, pixels, rounds, python):
    rng = np.random.default_rng(8)
    nudge = lambda: (rotation(np.radians(1) * rng.standard_normal((1, 3)))[0], 0.02 * rng.standard_normal(3))
    rt = lambda r, t: np.concatenate([rotation_vector(r), t])
    moved = lambda r, t: (lambda turn, shift: rt(turn @ r, t + shift))(*nudge())
    np.savez(
        folder / "rig.npz",
        pixels=pixels,
        rows=ROWS,
        columns=COLUMNS,
        spacing_m=SPACING_M,
        intrinsics=np.array([[*c["matrix"], *c["distortion"]] for c in cameras]),
        sizes=np.array([c["size"] for c in cameras]),
        extrinsics=np.array([moved(c["r"], c["t"]) for c in cameras[1:]]),
        frames=np.array([moved(r, t) for r, t in views]),
    )
    script = Path(__file__).with_name("mrcal_rig.py")
    run = subprocess.run([python, str(script), str(folder / "rig.npz"), str(rounds)], capture_output=True, text=True)
    if run.returncode != 0:
        print(f"mrcal left out: {run.stderr.strip().splitlines()[-1] if run.stderr.strip() else 'it failed'}; on Debian: apt install python3-mrcal\n")
        return None
    return json.loads(run.stdout)


def many_cameras(program, folder, rounds, python):
    board = scenes.grid(COLUMNS, ROWS, SPACING_M)
    cameras, views, pixels = scenes.rig(board=board, **MANY)
    n_points = int(np.isfinite(pixels[..., 0]).sum())
    scenes.write(folder / "rig.csv", cameras, board, pixels, MANY["noise_px"])
    peer = mrcal(folder, cameras, views, pixels, rounds, python)
    plain = resight(program, folder / "rig.csv", rounds, "squared")
    ours = resight(program, folder / "rig.csv", rounds)
    print(f"{MANY['n_cameras']} cameras × {MANY['n_views']} views, {n_points} points, {MANY['noise_px']} px; fastest of {rounds}\n")
    print("| | time | against Resight | worst camera's error |\n| --- | ---: | ---: | ---: |")

    def row(name, seconds, ours_seconds, poses):
        worst = np.max([errors(p[:, :3], p[:, 3], c) for p, c in zip(poses, cameras[1:])], axis=0)
        print(f"| {name} | {1e3 * seconds:.0f} ms | {seconds / ours_seconds:.1f} × | {worst[0]:.4f}°, {worst[1]:.3f} mm |")

    ours_poses, plain_poses = np.array(ours["cam_from_rig"])[1:], np.array(plain["cam_from_rig"])[1:]
    if peer:
        theirs = np.array(peer["cam_from_rig"])
        row(f"mrcal {peer['version']}, plain, from a start 1°, 20 mm off", peer["perturbed_s"], plain["seconds"], theirs)
        row("mrcal, plain, from its own optimum", peer["optimum_s"], plain["seconds"], theirs)
    row("**Resight, plain, from nothing, with covariances**", plain["seconds"], plain["seconds"], plain_poses)
    if peer:
        rejecting = np.array(peer["rejecting_cam_from_rig"])
        row("mrcal, looking for wrong points, from the same start", peer["rejecting_s"], ours["seconds"], rejecting)
    row("**Resight, looking for wrong points (its default)**", ours["seconds"], ours["seconds"], ours_poses)
    if peer:
        print(f"\nLargest difference of any entry of [R | t] (metres) between the two plain optima: {np.abs(theirs - plain_poses).max():.1e}; Resight's default used {ours['n_used']} of {ours['n_seen']} points.")
    print()


# ---- two cameras


def stereo_calibrate(board, cameras, pixels):
    both = [v for v in range(len(pixels)) if np.isfinite(pixels[v]).all()]
    matrices = [np.array([[c["matrix"][0], 0, c["matrix"][2]], [0, c["matrix"][1], c["matrix"][3]], [0, 0, 1]]) for c in cameras]
    seen = [[pixels[v, c].astype(np.float32) for v in both] for c in range(2)]
    points = [board.astype(np.float32)] * len(both)
    zero = np.zeros(5)
    started = time.perf_counter()
    found = cv2.stereoCalibrate(points, *seen, matrices[0], zero, matrices[1], zero, scenes.SIZE, flags=cv2.CALIB_FIX_INTRINSIC)
    return time.perf_counter() - started, found[5], found[6]


def mean_of_single_poses(board, cameras, pixels):
    matrices = [np.array([[c["matrix"][0], 0, c["matrix"][2]], [0, c["matrix"][1], c["matrix"][3]], [0, 0, 1]]) for c in cameras]
    started = time.perf_counter()
    turns, shifts = [], []
    for of_view in pixels:
        if not np.isfinite(of_view).all():
            continue
        poses = []
        for c in range(2):
            _, rvec, tvec = cv2.solvePnP(board, of_view[c], matrices[c], None, flags=cv2.SOLVEPNP_SQPNP)
            rvec, tvec = cv2.solvePnPRefineLM(board, of_view[c], matrices[c], None, rvec, tvec)
            poses.append((cv2.Rodrigues(rvec)[0], tvec.ravel()))
        (r0, t0), (r1, t1) = poses
        turns.append(r1 @ r0.T)
        shifts.append(t1 - r1 @ r0.T @ t0)
    u, _, vt = np.linalg.svd(np.mean(turns, axis=0))
    return time.perf_counter() - started, u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt, np.mean(shifts, axis=0)


def two_cameras(program, folder, rounds, trials):
    print(f"2 cameras × {PAIR['n_views']} views, {PAIR['noise_px']} px, {trials} trials: rms error of the second camera's pose, median time\n")
    print("| | the paper's four points | | 48-point board | |\n| --- | ---: | ---: | ---: | ---: |")
    rows = {"OpenCV stereoCalibrate": [], "OpenCV SQPNP + RefineLM, poses averaged": [], "**Resight**": []}
    for board in (scenes.wang(), scenes.grid(8, 6, 0.2)):
        found = {name: [] for name in rows}
        for trial in range(trials):
            cameras, _, pixels = scenes.rig(board=board, seed=100 + trial, **PAIR)
            scenes.write(folder / "pair.csv", cameras, board, pixels, PAIR["noise_px"])
            ours = resight(program, folder / "pair.csv", rounds)
            pose = np.array(ours["cam_from_rig"][1])
            answers = [stereo_calibrate(board, cameras, pixels), mean_of_single_poses(board, cameras, pixels), (ours["seconds"], pose[:, :3], pose[:, 3])]
            for name, (seconds, r, t) in zip(rows, answers):
                found[name].append((seconds, *errors(r, t, cameras[1])))
        for name, results in found.items():
            results = np.array(results)
            degrees, millimetres = np.sqrt((results[:, 1:] ** 2).mean(0))
            rows[name] += [f"{degrees:.4f}°, {millimetres:.2f} mm", f"{1e3 * np.median(results[:, 0]):.1f} ms"]
    for name, cells in rows.items():
        print(f"| {name} | {' | '.join(cells)} |")
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="the example bench_rig")
    parser.add_argument("--folder", type=Path, required=True, help="for the scenes")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--mrcal-python", default="/usr/bin/python3", help="a Python that can import mrcal")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    many_cameras(arguments.program, arguments.folder, arguments.rounds, arguments.mrcal_python)
    two_cameras(arguments.program, arguments.folder, arguments.rounds, arguments.trials)


if __name__ == "__main__":
    main()
