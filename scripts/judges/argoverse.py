"""av2 projects points of the vehicle with its PinholeCamera, and argoverse-api's projection (version 1), restated: our pixels.

av2 reads Feather: the tables are written as such from the CSV that our reader reads. The restatement takes
`vehicle_SE3_camera_` as camera to vehicle with a quaternion w first, and the intrinsic matrix without distortion
(`get_camera_extrinsic_matrix`, `get_camera_intrinsic_matrix`, `project_cam_to_image`).
"""

import csv
import json
import pathlib
import tempfile

import numpy as np
from pyquaternion import Quaternion

from _rigs import GOLDEN, judge, skip

EXAMPLES = GOLDEN.parents[1]

info = json.loads((EXAMPLES / "argoverse1" / "vehicle_calibration_info.json").read_text())
cameras = {c["key"].removeprefix("image_raw_"): c["value"] for c in info["camera_data_"]}


def pixel(camera, x):
    c = cameras[camera]
    pose = c["vehicle_SE3_camera_"]
    x_in_cam = Quaternion(pose["rotation"]["coefficients"]).inverse.rotate(np.array(x) - pose["translation"])
    k = [[c["focal_length_x_px_"], c["skew_"], c["focal_center_x_px_"]], [0, c["focal_length_y_px_"], c["focal_center_y_px_"]], [0, 0, 1]]
    u, v, w = np.array(k) @ x_in_cam
    return u / w, v / w


judge("argoverse-api's projection, restated", "argoverse1", pixel, file="pixels_files")
try:
    import pandas as pd
    from av2.geometry.camera.pinhole_camera import PinholeCamera
except ImportError as reason:
    skip(f"argoverse.py, version 2: {reason}")
with tempfile.TemporaryDirectory() as log:
    folder = pathlib.Path(log) / "calibration"
    folder.mkdir()
    for name in ("intrinsics", "egovehicle_SE3_sensor"):
        pd.read_csv(EXAMPLES / "argoverse2" / f"{name}.csv").to_feather(folder / f"{name}.feather")
    names = [row["sensor_name"] for row in csv.DictReader((EXAMPLES / "argoverse2" / "intrinsics.csv").open())]
    loaded = {name: PinholeCamera.from_feather(pathlib.Path(log), name) for name in names}
judge("av2", "argoverse2", lambda camera, x: loaded[camera].project_ego_to_img(np.array([x]))[0][0][:2], file="pixels_files")
