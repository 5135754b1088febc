"""Wrong inputs of two-camera rigs on real recordings: does the program know, beside OpenCV's stereoCalibrate with the intrinsics fixed.

Every pair of cameras of two recordings, solved from the corners that came with it, once with the right files and once with each fault in the
files of the second camera. An answer is *wrong* when the second camera's pose lies more than three times its own standard deviations (three
numbers of rotation, three of translation, the largest counts) and more than 0.1 degrees or 1 mm from that with the right files. OpenCV states neither a standard deviation nor a
verdict; its root mean square residual is what there is to judge by. Resight takes its default of 0.5 px for the corners.

Needs the recordings `opencv_stereo_chessboard` and `caliscope_4cam_charuco` in the folder --data.
"""

import argparse
import csv
import json
import subprocess
import tempfile
import tomllib
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np



def number(text):
    return float(text.removeprefix("np.float64(").removesuffix(")"))


def chessboard(folder):
    truth = json.loads((folder / "truth.json").read_text())
    cameras = {
        name: dict(k=np.array(c["K"]), d=np.array(c["D"]), size=truth["image_size"])
        for name, c in truth["reference_calibration_opencv5"].items()
        if name in ("left", "right")
    }
    return cameras, read(folder, "camera", "view", "corner")


def caliscope(folder):
    file = tomllib.loads((folder / "camera_array.toml").read_text())
    cameras = {
        name: dict(k=np.array(c["matrix"]), d=np.array(c["distortions"]), size=c["size"])
        for name, c in file["cameras"].items()
    }
    return cameras, read(folder, "cam", "sync_index", "corner_id")


def read(folder, camera, view, corner):
    """{(camera, view): {corner: (point, pixel)}}"""
    seen = {}
    with open(folder / "detections.csv") as file:
        for row in csv.DictReader(file):
            point = [number(row[c]) for c in ("X_m", "Y_m", "Z_m")]
            pixel = [number(row[c]) for c in ("u_px", "v_px")]
            seen.setdefault((row[camera], row[view]), {})[row[corner]] = (point, pixel)
    return seen


def lens(camera, focal=1.0, centre_px=0.0, distorted=True):
    k = camera["k"].copy()
    k[0, 0] *= focal
    k[1, 1] *= focal
    k[:2, 2] += centre_px
    return dict(k=k, d=camera["d"] if distorted else np.zeros(5), size=camera["size"])


def late(seen, name):
    """The views of a camera, each under the name of the one before."""
    views = sorted({view for _, view in seen}, key=int)
    earlier = dict(zip(views[1:], views))
    moved = {(c, earlier.get(v) if c == name else v): points for (c, v), points in seen.items()}
    return {key: points for key, points in moved.items() if key[1] is not None}


def mislabelled(seen, name):
    """The corners of a camera in reverse order, in every third view."""
    views = sorted({view for _, view in seen}, key=int)[::3]
    out = dict(seen)
    for view in views:
        if points := seen.get((name, view)):
            names = sorted(points, key=int)
            out[name, view] = {a: (points[a][0], points[b][1]) for a, b in zip(names, reversed(names))}
    return out


def faults(cameras, seen, a, b):
    """(name, cameras, detections)"""
    wrong = lambda **how: cameras | {b: lens(cameras[b], **how)}
    yield "none", cameras, seen
    yield "focal length + 10 %", wrong(focal=1.1), seen
    yield "focal length − 10 %", wrong(focal=0.9), seen
    yield "focal length + 3 %", wrong(focal=1.03), seen
    yield "no distortion", wrong(distorted=False), seen
    yield "centre off by 40 px", wrong(centre_px=40.0), seen
    yield "half the image size", cameras | {b: dict(k=np.diag([0.5, 0.5, 1.0]) @ cameras[b]["k"], d=cameras[b]["d"], size=cameras[b]["size"])}, seen
    yield "files swapped", cameras | {a: cameras[b], b: cameras[a]}, seen
    yield "one view late", cameras, late(seen, b)
    yield "labels reversed in a third of the views", cameras, mislabelled(seen, b)


def resight(program, cameras, seen, a, b):
    with tempfile.TemporaryDirectory() as folder:
        arguments = [program, "rig", "--json", "--quiet", "--reference", a]
        for name in (a, b):
            c = cameras[name]
            path = Path(folder) / f"{name}.toml"
            path.write_text(
                f'model = "brown_conrady"\nwidth_px = {c["size"][0]}\nheight_px = {c["size"][1]}\n'
                f"fx_px = {c['k'][0, 0]}\nfy_px = {c['k'][1, 1]}\ncx_px = {c['k'][0, 2]}\ncy_px = {c['k'][1, 2]}\n"
                f"distortion = {list(map(float, c['d']))}\n"
            )
            arguments += ["--camera", f"{name}={path}"]
        detections = Path(folder) / "detections.csv"
        with open(detections, "w") as file:
            file.write("camera,view,id,x_m,y_m,z_m,u_px,v_px\n")
            for (camera, view), points in seen.items():
                if camera in (a, b):
                    for corner, (x, u) in points.items():
                        file.write(",".join(map(str, [camera, view, corner, *x, *u])) + "\n")
        done = subprocess.run([*arguments, "--detections", str(detections)], capture_output=True, text=True)
    answer = json.loads(done.stdout) if done.stdout else {"status": "error", "message": done.stderr}
    return answer, done.returncode


def opencv(cameras, seen, a, b):
    shared = [view for view in sorted({v for _, v in seen}, key=int) if (a, view) in seen and (b, view) in seen]
    points, first, second = [], [], []
    for view in shared:
        x, y = seen[a, view], seen[b, view]
        both = [c for c in x if c in y]
        if 4 <= len(both):
            points.append(np.float32([x[c][0] for c in both]))
            first.append(np.float32([x[c][1] for c in both]))
            second.append(np.float32([y[c][1] for c in both]))
    try:
        rms, _, _, _, _, r, t, *_ = cv2.stereoCalibrate(
            points, first, second, cameras[a]["k"], cameras[a]["d"], cameras[b]["k"], cameras[b]["d"],
            tuple(cameras[a]["size"]), flags=cv2.CALIB_FIX_INTRINSIC,
        )
    except cv2.error:
        return None
    return rms, np.asarray(r), np.asarray(t).ravel()


def pose(answer, b):
    placed = answer["cameras"][b]
    matrix = np.array(placed["cam_from_rig"]["matrix"])
    sigma = np.sqrt(np.diag(placed["covariance"]))
    return matrix[:3, :3], matrix[:3, 3], sigma


def apart(r, t, r0, t0):
    """Rotation about the camera's axes, rad, and motion of the camera's centre in its axes, m."""
    return cv2.Rodrigues(r @ r0.T)[0].ravel(), t - r @ r0.T @ t0


def differs(rotation, centre):
    return np.degrees(np.linalg.norm(rotation)) > 0.1 or np.linalg.norm(centre) > 1e-3


def row(program, case, a, b, truth):
    name, cameras, seen = case
    answer, code = resight(program, cameras, seen, a, b)
    peer = opencv(cameras, seen, a, b)
    status = answer["status"]
    says, is_wrong = "no pose", False
    if "cameras" in answer:
        r, t, sigma = pose(answer, b)
        truth.setdefault("resight", (r, t))
        rotation, centre = apart(r, t, *truth["resight"])
        off = np.concatenate([rotation, centre]) / np.maximum(sigma, 1e-12)
        is_wrong = differs(rotation, centre) and np.abs(off).max() > 3.0
        says = f"{np.degrees(np.linalg.norm(rotation)):.2f}° {1e3 * np.linalg.norm(centre):.1f} mm"
        says += f" ± {np.degrees(sigma[:3].max()):.2f}° {1e3 * sigma[3:].max():.1f} mm"
    beside = "error"
    if peer:
        truth.setdefault("opencv", peer[1:])
        rotation, centre = apart(*peer[1:], *truth["opencv"])
        beside = f"{np.degrees(np.linalg.norm(rotation)):.2f}° {1e3 * np.linalg.norm(centre):.1f} mm, rms {peer[0]:.2f} px"
    print(f"| {a} – {b} | {name} | {says} | {status}, {code} | {beside} |", flush=True)
    return name == "none", status == "ok", is_wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--folder", help="not used: nothing is kept")
    arguments = parser.parse_args()
    rows = []
    for title, (cameras, seen) in {
        "opencv_stereo_chessboard": chessboard(arguments.data / "opencv_stereo_chessboard"),
        "caliscope_4cam_charuco": caliscope(arguments.data / "caliscope_4cam_charuco"),
    }.items():
        print(f"\n{title}: change of the second camera's pose against the right files\n")
        print("| cameras | fault | Resight: change ± | status, exit | OpenCV: change, rms |\n| --- | --- | --- | --- | --- |")
        for a, b in combinations(sorted(cameras), 2):
            truth = {}
            rows += [row(arguments.program, case, a, b, truth) for case in faults(cameras, seen, a, b)]
    good = [ok for is_right, ok, _ in rows if is_right]
    bad = [(ok, wrong) for is_right, ok, wrong in rows if not is_right]
    print(f"\nright files: {sum(good)} of {len(good)} ok; with a fault: {sum(ok for ok, _ in bad)} of {len(bad)} ok, of which {sum(ok and wrong for ok, wrong in bad)} are wrong")


if __name__ == "__main__":
    main()
