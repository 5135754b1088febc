"""pykitti reads our odometry calibration, and its file reader the object one; their matrices give our pixels."""

import pathlib
import shutil
import tempfile

import numpy as np
import pykitti

from _rigs import GOLDEN as RIGS
from _rigs import folder, judge, opencv_pixel

EXAMPLES = RIGS.parents[1]

RIG = "kitti_object.txt"


def projected(p, x_in_rect):
    u, v, w = p @ [*x_in_rect, 1.0]
    return u / w, v / w


def check_odometry():
    with tempfile.TemporaryDirectory() as base:
        sequence = pathlib.Path(base) / "sequences" / "00"
        sequence.mkdir(parents=True)
        shutil.copy(folder() / "kitti_odometry" / "calib.txt", sequence)
        (sequence / "times.txt").write_text("0.0\n")
        calib = pykitti.odometry(base, "00").calib
        p = {f"cam{i}": getattr(calib, f"P_rect_{i}0") for i in range(4)}
        judge("pykitti, odometry", RIG, lambda camera, x: projected(p[camera], x), file="pixels_files")
        # Its own way from the scanner into each camera, with its K: the same pixel of a point ahead of the scanner. pykitti
        # takes the baseline along x alone, which is all there is for cameras 0 and 1.
        x_in_velo = np.array([12.0, 1.5, -0.4, 1.0])
        for i in range(2):
            x_in_cam = getattr(calib, f"T_cam{i}_velo") @ x_in_velo
            u, v, w = getattr(calib, f"K_cam{i}") @ x_in_cam[:3]
            ours = projected(p[f"cam{i}"], (calib.T_cam0_velo @ x_in_velo)[:3])
            assert np.hypot(u / w - ours[0], v / w - ours[1]) < 1e-6, i


def check_object():
    calib = pykitti.utils.read_calib_file(str(folder() / "kitti" / "calib.txt"))
    p = {f"cam{i}": calib[f"P{i}"].reshape(3, 4) for i in range(4)}
    judge("pykitti's reader, object benchmark", RIG, lambda camera, x: projected(p[camera], x), file="pixels_files")
    # x_rect = R0_rect Tr_velo_to_cam x_velo, as the benchmark says; the odometry file's Tr must be the same map.
    odometry = pykitti.utils.read_calib_file(str(folder() / "kitti_odometry" / "calib.txt"))
    tr = calib["R0_rect"].reshape(3, 3) @ calib["Tr_velo_to_cam"].reshape(3, 4)
    assert np.allclose(tr, odometry["Tr"].reshape(3, 4), rtol=0, atol=1e-14)
    # The example ends with a blank line as KITTI's own files do, which pykitti's reader does not take.
    example = dict(line.split(":") for line in (EXAMPLES / RIG).read_text().split("\n") if line)
    for key in ("R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo"):
        assert np.allclose(calib[key], np.fromstring(example[key], sep=" "), rtol=0, atol=1e-14), key


def check_unrectified():
    """The raw data's lens before rectification, by OpenCV: its five coefficients, and cam1_from_cam0."""
    calib = pykitti.utils.read_calib_file(str(EXAMPLES / "kitti_unrectified" / "calib_cam_to_cam.txt"))
    k, d, r, t = (calib[f"{key}_01"] for key in ("K", "D", "R", "T"))
    rig = "kitti_unrectified/calib_cam_to_cam.txt#cam1_unrectified"
    judge("pykitti's reader and OpenCV, raw", rig, lambda _, x: opencv_pixel(k, d, r.reshape(3, 3), t, x), file="pixels_files")


check_odometry()
check_object()
check_unrectified()
