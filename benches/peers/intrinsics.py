"""Intrinsics, Resight against OpenCV's calibrateCamera on the same corners; prints Markdown tables.

    python benches/peers/intrinsics.py --resight target/release/resight [--data FOLDER] [--trials 20]

Simulated: the truth is known. The error is that of the projection over the whole image (24 x 18 places), the rotation that fits best taken
out, as mrcal compares cameras. Recorded: each half of the views calibrates, the views of the other half are predicted (only their poses being
free); the root mean square is of one coordinate, of the corners that Resight uses.
"""

import argparse
import csv
import json
import os
import subprocess
import tempfile
import time

import cv2
import numpy as np
from scipy.optimize import least_squares

SIZE = (640, 480)
K = np.array([[800.0, 0, 325], [0, 798, 233], [0, 0, 1]])
LENSES = {
    "no distortion": np.zeros(5),
    "k1 k2 p1 p2": np.array([-0.25, 0.12, 1e-3, -7e-4, 0]),
    "k1 k2 p1 p2 k3": np.array([-0.3, 0.15, 5e-4, 4e-4, -0.05]),
}
BOARD = np.array([[0.03 * (i % 9), 0.03 * (i // 9), 0] for i in range(54)])


def simulated(rng, distortion, n_views, sigma_px):
    views = []
    while len(views) < n_views:
        tilt, about, turn = rng.uniform(0.1, 0.85), rng.uniform(0, 2 * np.pi), rng.uniform(-0.4, 0.4)
        rotation = cv2.Rodrigues(tilt * np.array([np.cos(about), np.sin(about), 0]))[0] @ cv2.Rodrigues(np.array([0, 0, turn]))[0]
        pixel = rng.uniform([100, 80], [540, 400])
        ray = np.linalg.solve(K, [*pixel, 1])
        t = ray / np.linalg.norm(ray) * rng.uniform(0.3, 0.9) - rotation @ BOARD.mean(0)
        if ((BOARD @ rotation.T + t)[:, 2] < 0.05).any():
            continue
        seen = cv2.projectPoints(BOARD, cv2.Rodrigues(rotation)[0], t, K, distortion)[0][:, 0]
        inside = ((seen > 0) & (seen < np.array(SIZE) - 1)).all(1)
        if inside.mean() >= 0.9:
            views.append((BOARD[inside], seen[inside] + sigma_px * rng.normal(size=(inside.sum(), 2))))
    return views


def opencv(views, size):
    begin = time.perf_counter()
    rms, matrix, distortion, *_ = cv2.calibrateCamera(
        [x.astype(np.float32) for x, _ in views], [u.astype(np.float32) for _, u in views], size, None, None
    )
    return matrix, distortion.ravel(), time.perf_counter() - begin


def resight(program, views, size):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "corners.csv")
        with open(path, "w") as file:
            file.write("view,id,x_m,y_m,z_m,u_px,v_px\n")
            for v, (points, pixels) in enumerate(views):
                for i, (x, u) in enumerate(zip(points, pixels)):
                    file.write(f"{v},{i},{x[0]!r},{x[1]!r},{x[2]!r},{u[0]!r},{u[1]!r}\n".replace("np.float64(", "").replace(")", ""))
        command = [program, "intrinsics", "--detections", path, "--image-size-px", f"{size[0]}x{size[1]}", "--json", "--quiet"]
        command += ["--model", "brown_conrady"]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True)
        seconds = time.perf_counter() - begin
    camera = json.loads(done.stdout)["cameras"][0]
    found = camera["intrinsics"]
    if found is None:
        return None, None, seconds, camera
    values = {p["name"]: p["value"] for p in found["parameters"]}
    matrix = np.array([[values["fx_px"], 0, values["cx_px"]], [0, values["fy_px"], values["cy_px"]], [0, 0, 1]])
    distortion = [values.get(name, 0.0) for name in ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]]
    return matrix, np.array(distortion), seconds, camera


def projection_error(true_matrix, true_distortion, matrix, distortion, size):
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, 24), np.linspace(0, size[1] - 1, 18))
    pixels = np.stack([u.ravel(), v.ravel()], 1)
    rays = np.linalg.solve(true_matrix, np.concatenate([pixels, np.ones((len(pixels), 1))], 1).T).T
    for _ in range(200):
        back = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), true_matrix, true_distortion)[0][:, 0]
        rays[:, :2] += (pixels - back) / np.diag(true_matrix)[:2]
    off = lambda w: (cv2.projectPoints(rays, w, np.zeros(3), matrix, distortion)[0][:, 0] - pixels).ravel()
    fitted = least_squares(off, np.zeros(3)).fun.reshape(-1, 2)
    return float(np.sqrt((fitted**2).sum(1).mean()))


def predicted(views, matrix, distortion):
    """Squares of the residuals of views under a camera, only their poses being free."""
    squares = []
    for x, u in views:
        _, r, t = cv2.solvePnP(x, u, matrix, distortion)
        r, t = cv2.solvePnPRefineLM(x, u, matrix, distortion, r, t)
        squares.append(((cv2.projectPoints(x, r, t, matrix, distortion)[0][:, 0] - u) ** 2).ravel())
    return np.concatenate(squares)


def table_of_simulations(program, trials):
    print("| lens | views | OpenCV (px) | Resight (px) | Resight / OpenCV |\n| --- | --- | --- | --- | --- |")
    for name, distortion in LENSES.items():
        for n_views in (8, 20):
            rng, errors = np.random.default_rng(11), []
            for _ in range(trials):
                views = simulated(rng, distortion, n_views, 0.2)
                a = opencv(views, SIZE)
                b = resight(program, views, SIZE)
                errors.append([projection_error(K, distortion, c[0], c[1], SIZE) for c in (a, b)])
            a, b = np.sqrt((np.array(errors) ** 2).mean(0))
            print(f"| {name} | {n_views} | {a:.3f} | {b:.3f} | {b / a:.2f} |", flush=True)


def table_of_times(program):
    views = simulated(np.random.default_rng(12), LENSES["k1 k2 p1 p2 k3"], 100, 0.2)
    a = min(opencv(views, SIZE)[2] for _ in range(3))
    b = min(resight(program, views, SIZE)[2] for _ in range(3))
    print(f"\n100 views x 54 corners: OpenCV {a:.2f} s, Resight {b:.2f} s (with start of the program and reading), ratio {b / a:.2f}\n")


def number(text):
    return float(text.replace("np.float64(", "").replace(")", ""))


def recorded(folder):
    """Sets of views by name: chessboards of a stereo pair, ChArUco boards of four webcams."""
    sets = {}
    with open(os.path.join(folder, "opencv_stereo_chessboard", "detections.csv")) as file:
        for row in csv.reader(line for line in file if not line.startswith("camera")):
            x = [0.025 * int(row[4]), 0.025 * int(row[3]), 0.0]
            view = sets.setdefault(f"chessboard {row[0]}", ({}, (640, 480)))[0].setdefault(int(row[1]), [])
            view.append((x, [float(row[-2]), float(row[-1])]))
    with open(os.path.join(folder, "caliscope_4cam_charuco", "detections.csv")) as file:
        for row in csv.DictReader(file):
            view = sets.setdefault(f"webcam {row['cam']}", ({}, (1280, 720)))[0].setdefault(int(row["sync_index"]), [])
            view.append(([float(row["X_m"]), float(row["Y_m"]), 0.0], [float(row["u_px"]), float(row["v_px"])]))
    for name, (views, size) in sets.items():
        arrays = [(np.array([x for x, _ in v]), np.array([u for _, u in v])) for _, v in sorted(views.items()) if 8 <= len(v)]
        yield name, arrays, size


def table_of_recordings(program, folder):
    print("| recording | views | OpenCV predicts (px) | Resight predicts (px) | fx OpenCV | fx Resight | halves of Resight differ by |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, views, size in recorded(folder):
        squares, halves = {"opencv": [], "resight": []}, []
        for own, other in ((views[::2], views[1::2]), (views[1::2], views[::2])):
            a, b = opencv(own, size), resight(program, own, size)
            if b[0] is None:
                print(f"| {name} | {len(own)} | | refused: {b[3]['message']} | | | |")
                break
            f = next(p for p in b[3]["intrinsics"]["parameters"] if p["name"] == "fx_px")
            halves.append((f["value"], f["sigma"]))
            for key, camera in (("opencv", a), ("resight", b)):
                squares[key].append(predicted(other, camera[0], camera[1]))
        else:
            # Medians over corners: the sets hold corners that are pixels off.
            typical = lambda key: np.sqrt(np.median(np.concatenate(squares[key])) / 0.4549)
            a, b = opencv(views, size), resight(program, views, size)
            f = next(p for p in b[3]["intrinsics"]["parameters"] if p["name"] == "fx_px")
            z = (halves[0][0] - halves[1][0]) / np.hypot(halves[0][1], halves[1][1])
            print(
                f"| {name} | {len(views)} | {typical('opencv'):.3f} | {typical('resight'):.3f} | {a[0][0, 0]:.2f} | {f['value']:.2f} ± {f['sigma']:.2f} | {z:+.1f} σ |",
                flush=True,
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--resight", default="target/release/resight")
    parser.add_argument("--data", default=os.environ.get("RESIGHT_DATA"))
    parser.add_argument("--trials", type=int, default=20)
    args = parser.parse_args()
    print(f"OpenCV {cv2.__version__}\n")
    table_of_simulations(args.resight, args.trials)
    table_of_times(args.resight)
    if args.data:
        table_of_recordings(args.resight, args.data)


main()
