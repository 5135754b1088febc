"""Everybody called from Python, what a call costs included for all: the table of the README (four points), one view, a thousand views in one
call, the cost of a call alone, and rigs beside OpenCV's calibrateMultiview. Prints Markdown.

Times are of one thread, the least of several rounds in which the contenders take turns. `--rust PROGRAM` (bench_points) prints what the same
jobs take in Rust, in nanoseconds, so that the share of the call is known; nobody else is compared with those figures.
"""

import argparse
import subprocess
import time

import cv2
import numpy as np

import four_points
import resight
import rig_scenes
from resight import cv
from rig import errors

SIZE = four_points.SIZE
K = four_points.CAMERA
LINE = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0]])
RVEC, TVEC = np.array([0.3, -0.5, 0.1]), np.array([0.02, 0.03, 1.2])
RIGS = [dict(n_cameras=2, n_views=40), dict(n_cameras=4, n_views=40), dict(n_cameras=8, n_views=100)]


def least_us(calls, rounds=30, n=200):
    """{name: µs a call}, in turns."""
    least = dict.fromkeys(calls, np.inf)
    for _ in range(rounds):
        for name, call in calls.items():
            start = time.perf_counter_ns()
            for _ in range(n):
                call()
            least[name] = min(least[name], (time.perf_counter_ns() - start) / n / 1e3)
    return least


def calls_alone(rust):
    truth, camera = resight.Pose.from_vectors(RVEC, TVEC), resight.Camera.from_matrix(K, image_size_px=SIZE)
    pixels = camera.project(truth @ LINE)
    calls = {
        "cv2.norm": lambda: cv2.norm(pixels),
        "resight.solve": lambda: resight.solve(LINE, pixels, camera, sigma_px=0.3),
        "resight.cv.solvePnP": lambda: cv.solvePnP(LINE, pixels, K, None, sigma_px=0.3),
    }
    found = least_us(calls)
    print("| one view of four points | µs |\n| --- | ---: |")
    for name, us in found.items():
        print(f"| {name} | {us:.2f} |")
    # The thousand views of `bench_points`.
    phase, (u, v) = np.arange(1000.0)[:, None], pixels.round(2).T
    many = np.stack([u + 0.5 * np.sin(3.1 * phase + v), v + 0.5 * np.cos(1.7 * phase + u)], axis=-1)
    thousand = {"many": lambda: resight.solve_many(LINE, many, camera, sigma_px=0.3)}
    if not rust:
        print(f"\n1000 views in one call: {least_us(thousand, n=5)['many'] / 1000:.3f} µs a view")
        return
    views, one, in_rust = np.inf, np.inf, np.inf
    for _ in range(5):  # In turns.
        printed = subprocess.run([rust], check=True, capture_output=True, text=True).stdout
        one, in_rust = (min(least, float(ns) / 1e3) for least, ns in zip((one, in_rust), printed.split()))
        views = min(views, least_us(thousand, rounds=10, n=5)["many"] / 1000)
    share = found["resight.solve"] - one
    print(f"\nThe same view in Rust {one:.2f} µs: the call is {share:.2f} µs of it; to beat: {found['cv2.norm'] + 2:.2f} (cv2.norm and 2 µs).")
    print(f"1000 views in one call {views:.3f} µs a view, in Rust {in_rust:.3f}: {100 * (views / in_rust - 1):+.1f} %.")


def multiview(cameras, board, pixels):
    """OpenCV's rig from the views in which a camera sees the whole board; with partly seen boards it diverges. Poses cam_from_rig."""
    whole = np.isfinite(pixels).all(axis=(2, 3))
    views = np.flatnonzero(whole.any(axis=1))
    none = np.zeros((0, 1, 2), np.float32)
    seen = [[pixels[v, c].reshape(-1, 1, 2).astype(np.float32) if whole[v, c] else none for v in views] for c in range(len(cameras))]
    matrices = [np.array([[c["matrix"][0], 0, c["matrix"][2]], [0, c["matrix"][1], c["matrix"][3]], [0, 0, 1]]) for c in cameras]
    fixed = np.full(len(cameras), cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_INTRINSIC, np.int32)
    *_, rotations, translations = cv2.calibrateMultiview(
        [board.astype(np.float32)] * len(views), seen, [c["size"] for c in cameras], whole[views].T.astype(np.uint8),
        np.zeros(len(cameras), np.uint8), matrices, [c["distortion"].reshape(1, 5).copy() for c in cameras], None, None,
        flagsForIntrinsics=fixed, flags=cv2.CALIB_USE_INTRINSIC_GUESS)
    return [(cv2.Rodrigues(r)[0] if np.size(r) == 3 else r, t) for r, t in zip(rotations, translations)]


def columns(board, pixels):
    """The points as a table, and only of whole boards, which is what OpenCV gets."""
    view, camera, point = np.nonzero(np.isfinite(pixels).all(axis=(2, 3))[..., None] & np.ones(len(board), bool))
    u_px, v_px = pixels[view, camera, point].T
    x_m, y_m, z_m = board[point].T
    return {"camera": camera, "view": view, "id": point, "x_m": x_m, "y_m": y_m, "z_m": z_m, "u_px": u_px, "v_px": v_px}


def rigs(rounds):
    print("\n| cameras × views | calibrateMultiview | worst camera | `rig_from_detections` | worst camera |\n| --- | ---: | ---: | ---: | ---: |")
    board, noise_px = rig_scenes.grid(8, 6, 0.1), 0.3
    for scene in RIGS:
        cameras, _, pixels = rig_scenes.rig(board=board, noise_px=noise_px, seed=8, **scene)
        lenses = {str(i): lens(camera) for i, camera in enumerate(cameras)}
        table = columns(board, pixels)
        least = [np.inf, np.inf]
        for _ in range(rounds):
            start = time.perf_counter()
            theirs = multiview(cameras, board, pixels)
            least[0], start = min(least[0], time.perf_counter() - start), time.perf_counter()
            rig = resight.rig_from_detections(lenses, table, sigma_px=noise_px)
            least[1] = min(least[1], time.perf_counter() - start)
        matrices = [rig.cameras[str(i)]["cam_from_rig"]["matrix"] for i in range(len(cameras))]
        ours = [(np.array(m)[:3, :3], np.array(m)[:3, 3]) for m in matrices]
        worst = [np.max([errors(r, t, camera) for (r, t), camera in zip(poses, cameras)][1:], axis=0) for poses in (theirs, ours)]
        cells = [f"{1e3 * s:.0f} ms | {turn:.4f}°, {shift:.3f} mm" for s, (turn, shift) in zip(least, worst)]
        print(f"| {scene['n_cameras']} × {scene['n_views']} | {' | '.join(cells)} |")


def lens(camera):
    fx, fy, cx, cy = camera["matrix"]
    size = dict(zip(("width_px", "height_px"), camera["size"]))
    return resight.Camera("brown_conrady", **size, fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=camera["distortion"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rust", help="the program bench_points")
    parser.add_argument("--folder", help="not used")
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3, help="of the rigs")
    arguments = parser.parse_args()
    four_points.print_table([(r, 0.5) for r in four_points.RANGES_M], arguments.scenes)
    print()
    calls_alone(arguments.rust)
    rigs(arguments.rounds)


if __name__ == "__main__":
    main()
