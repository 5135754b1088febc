"""What the judges of rigs share: the points with our pixels, and the comparison.

Each judge takes the folder of written files (default: the goldens, byte for byte what the writers write) and exits
with 1 when another program's pixel is not ours. `pixels/pixels.csv` there holds points in the world and our pixels.
"""

import csv
import math
import pathlib
import sys

GOLDEN = pathlib.Path(__file__).resolve().parents[2] / "testdata" / "formats" / "golden" / "rigs"


def folder():
    return pathlib.Path(sys.argv[1]) if 1 < len(sys.argv) else GOLDEN


def points(rig, file="pixels"):
    """{camera: [(x, y, z in the world, m), (u, v in px)]}"""
    found = {}
    with open(folder() / file / "pixels.csv", newline="") as rows:
        for row in csv.DictReader(rows):
            if row["rig"] == rig:
                x = tuple(float(row[k]) for k in ("x_m", "y_m", "z_m"))
                found.setdefault(row["camera"], []).append((x, (float(row["u_px"]), float(row["v_px"]))))
    assert found, f"no points of {rig}"
    return found


def judge(program, rig, project, tolerance_px=1e-6, cameras=None, file="pixels"):
    """`project(camera, x_in_world)` gives the other program's pixel, with (0, 0) the centre of the first pixel."""
    worst, count = 0.0, 0
    for camera, pairs in points(rig, file).items():
        if cameras is not None and camera not in cameras:
            continue
        for x, (u, v) in pairs:
            a, b = project(camera, x)
            off = math.hypot(a - u, b - v)
            if not off <= tolerance_px:
                print(f"FAILED: {program}: {camera}, point {x}: pixel ({a}, {b}), ours ({u}, {v})", file=sys.stderr)
                sys.exit(1)
            worst, count = max(worst, off), count + 1
    assert count, "nothing was compared"
    print(f"{program}: {count} points within {worst:.1e} px of ours")


def skip(reason):
    print(f"SKIPPED: {reason}")
    sys.exit(0)


def opencv_pixel(matrix, distortion, rotation, translation, x, fisheye=False):
    """OpenCV's own projection of one point."""
    import cv2
    import numpy as np

    rvec = cv2.Rodrigues(np.asarray(rotation, float))[0] if np.size(rotation) == 9 else np.asarray(rotation, float)
    model = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    where = np.asarray(x, float).reshape(1, 1, 3)
    t = np.asarray(translation, float).reshape(3, 1)
    k, d = np.asarray(matrix, float).reshape(3, 3), np.asarray(distortion, float).ravel()
    out = model(where, np.ascontiguousarray(rvec.reshape(3, 1)), np.ascontiguousarray(t), k, d)[0]
    return out.ravel()
