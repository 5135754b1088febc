"""Basalt's JSON through its loader, restated: Basalt is not on PyPI.

The restatement, from basalt-headers' serialization: every key below must be there; T_imu_cam is a pose with quaternion
(qx, qy, qz, qw) that maps camera points into the IMU's frame; kb4 is OpenCV's fisheye, pinhole-radtan8 its rational model.
"""

import json
import tomllib

import numpy as np
from pyquaternion import Quaternion

from _lenses import eucm, fov
from _rigs import GOLDEN as RIGS
from _rigs import folder, judge, opencv_pixel

EXAMPLES = RIGS.parents[1]

KEYS = {
    "T_imu_cam": 4, "intrinsics": 4, "resolution": 4, "calib_accel_bias": 9, "calib_gyro_bias": 12, "imu_update_rate": 0,
    "accel_noise_std": 3, "gyro_noise_std": 3, "accel_bias_std": 3, "gyro_bias_std": 3, "cam_time_offset_ns": 0, "vignette": 0,
}  # fmt: skip
calib = json.loads((folder() / "basalt" / "calibration.json").read_text())["value0"]
for key, length in KEYS.items():
    assert key in calib, f"{key} is missing: Basalt refuses the file"
    assert length == 0 or len(calib[key]) == length, key
assert isinstance(calib["cam_time_offset_ns"], int)
NAMES = [c["name"] for c in tomllib.loads((EXAMPLES / "placed_wide.toml").read_text())["camera"]]

BY_OPENCV = {"kb4": ["k1", "k2", "k3", "k4"], "pinhole-radtan8": ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]}


def pixel(camera, x):
    i = NAMES.index(camera)
    pose, lens = calib["T_imu_cam"][i], calib["intrinsics"][i]
    imu_from_cam = Quaternion(pose["qw"], pose["qx"], pose["qy"], pose["qz"])
    x_in_cam = imu_from_cam.inverse.rotate(np.array(x) - [pose["px"], pose["py"], pose["pz"]])
    n, kind = lens["intrinsics"], lens["camera_type"]
    k = [n["fx"], 0, n["cx"], 0, n["fy"], n["cy"], 0, 0, 1]
    if kind in BY_OPENCV:
        distortion = [n[key] for key in BY_OPENCV[kind]]
        return opencv_pixel(k, distortion, np.eye(3), np.zeros(3), x_in_cam, fisheye=kind == "kb4")
    a, b = fov(n["w"], x_in_cam) if kind == "fov" else eucm(n["alpha"], n["beta"], x_in_cam)
    return n["fx"] * a + n["cx"], n["fy"] * b + n["cy"]


judge("Basalt's loader, restated", "placed_wide", pixel)
