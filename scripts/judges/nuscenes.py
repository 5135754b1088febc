"""pyquaternion, with which the nuScenes devkit reads its tables, gives our pixels.

The devkit moves a point from the vehicle into a sensor by subtracting `translation` and turning by the inverse of
Quaternion(`rotation`), then applies `camera_intrinsic`; that is done here (the devkit itself brings 400 MB).
"""

import json

import numpy as np
from pyquaternion import Quaternion

from _rigs import GOLDEN as RIGS
from _rigs import folder, judge

EXAMPLES = RIGS.parents[1]

tables = {name: json.loads((folder() / "nuscenes" / f"{name}.json").read_text()) for name in ("sensor", "calibrated_sensor")}
channel = {s["token"]: s["channel"] for s in tables["sensor"]}
modality = {s["channel"]: s["modality"] for s in tables["sensor"]}
sensors = {channel[c["sensor_token"]]: c for c in tables["calibrated_sensor"]}
assert modality == {"CAM_FRONT": "camera", "CAM_BACK": "camera", "LIDAR_TOP": "lidar"}, modality
assert len({c["token"] for c in sensors.values()} | set(channel)) == 6, "tokens repeat"


def pixel(camera, x):
    c = sensors[camera]
    x_in_cam = Quaternion(c["rotation"]).inverse.rotate(np.array(x) - c["translation"])
    u, v, w = np.array(c["camera_intrinsic"]) @ x_in_cam
    return u / w, v / w


judge("pyquaternion", "nuscenes", pixel, file="pixels_files")
example = json.loads((EXAMPLES / "nuscenes" / "calibrated_sensor.json").read_text())[1]
lidar = sensors["LIDAR_TOP"]
assert lidar["camera_intrinsic"] == []
assert Quaternion.absolute_distance(Quaternion(lidar["rotation"]), Quaternion(example["rotation"])) < 1e-14
assert np.allclose(lidar["translation"], example["translation"], rtol=0, atol=1e-14)
