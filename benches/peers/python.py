"""Calls from Python, their overheads included for all: one view of four points, a thousand views in one call, and the door alone.

Prints Markdown tables. Times are of one thread, the least of 30 rounds in which the contenders take turns; `--rust PROGRAM` prints what
the same jobs take in Rust, in nanoseconds, so that the door's own share is known.
"""

import argparse
import subprocess
import time

import cv2
import numpy as np
import poselib

import resight
from resight import cv

try:
    import pycolmap
except ImportError:  # no wheel for this machine: its rows are left out
    pycolmap = None

SIZE = (1280, 960)
K = np.array([[1000.0, 0, 639.5], [0, 1000, 479.5], [0, 0, 1]])
LINE = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0]])
SQUARE = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.075
RVEC, TVEC = np.array([0.3, -0.5, 0.1]), np.array([0.02, 0.03, 1.2])
COLMAP = {"model": "PINHOLE", "width": SIZE[0], "height": SIZE[1], "params": [1000, 1000, 639.5, 479.5]}


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


def one_view(points, pixels):
    camera = resight.Camera.from_matrix(K, image_size_px=SIZE)
    calls = {
        "resight.solve, covariance and ambiguity": lambda: resight.solve(points, pixels, camera, sigma_px=0.3),
        "resight.cv.solvePnP": lambda: cv.solvePnP(points, pixels, K, None, sigma_px=0.3),
        "cv2.solvePnP SQPNP": lambda: cv2.solvePnP(points, pixels, K, None, flags=cv2.SOLVEPNP_SQPNP),
        "cv2.solvePnP AP3P": lambda: cv2.solvePnP(points, pixels, K, None, flags=cv2.SOLVEPNP_AP3P),
        "cv2.solvePnP ITERATIVE": lambda: cv2.solvePnP(points, pixels, K, None),
        "poselib, 10 iterations": lambda: poselib.estimate_absolute_pose(pixels, points, COLMAP, {"min_iterations": 10}, {}),
    }
    if pycolmap:
        of_colmap = pycolmap.Camera(model="PINHOLE", width=SIZE[0], height=SIZE[1], params=COLMAP["params"])
        calls["pycolmap"] = lambda: pycolmap.estimate_and_refine_absolute_pose(pixels, points, of_colmap)
    return {name: call for name, call in calls.items() if _works(call)}


def _works(call):
    try:
        call()
    except Exception:  # noqa: BLE001, whatever it raises it has no answer.
        return False
    return True


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rust", help="the program bench_points")
    parser.add_argument("--folder", help="not used")
    arguments = parser.parse_args()
    truth = resight.Pose.from_vectors(RVEC, TVEC)
    camera = resight.Camera.from_matrix(K, image_size_px=SIZE)
    for title, points in (("three points on a line, one off it", LINE), ("a square", SQUARE)):
        pixels = camera.project(truth @ points)
        print(f"\n| one view of four points, {title} | µs a call |\n| --- | --- |")
        for name, us in least_us(one_view(points, pixels)).items():
            print(f"| {name} | {us:.1f} |")
    pixels = camera.project(truth @ LINE)
    door = least_us({"cv2.norm": lambda: cv2.norm(pixels), "solve": lambda: resight.solve(LINE, pixels, camera, sigma_px=0.3)})
    print("\n| the door alone, one view of four points | µs |\n| --- | --- |")
    print(f"| cv2.norm | {door['cv2.norm']:.2f} |\n| resight.solve | {door['solve']:.2f} |")
    if arguments.rust:
        printed = subprocess.run([arguments.rust], check=True, capture_output=True, text=True).stdout
        rust, rust_view = (float(ns) / 1e3 for ns in printed.split())
        print(f"| the same job in Rust | {rust:.2f} |\n| Python's share | {door['solve'] - rust:.2f} |")
    # The thousand views of `bench_points`.
    phase, (u, v) = np.arange(1000.0)[:, None], pixels.round(2).T
    many = np.stack([u + 0.5 * np.sin(3.1 * phase + v), v + 0.5 * np.cos(1.7 * phase + u)], axis=-1)
    thousand = least_us({"many": lambda: resight.solve_many(LINE, many, camera, sigma_px=0.3)}, n=5)["many"]
    print(f"\n1000 views in one call of resight.solve_many: {thousand / 1000:.3f} µs a view")
    if arguments.rust:
        print(f"The same in Rust: {rust_view:.3f} µs a view")


if __name__ == "__main__":
    main()
