"""The RobotCar SDK's projection, restated (it is no package), gives our pixels of points in the vehicle's frame.

`project_laser_into_camera.py`: camera points are build_se3_transform(extrinsics of the camera) · vehicle points, and
`CameraModel.project` solves with G_camera_image before focal lengths and principal point are applied;
R = Rz(yaw) Ry(pitch) Rx(roll) by scipy.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from _rigs import GOLDEN, judge

ROOT = GOLDEN.parents[1] / "robotcar"


def se3(file):
    numbers = [float(x) for x in file.read_text().split()]
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("ZYX", numbers[:2:-1]).as_matrix()
    pose[:3, 3] = numbers[:3]
    return pose


def pixel(camera, x):
    lines = (ROOT / "models" / f"{camera}.txt").read_text().splitlines()
    fx, fy, cx, cy = map(float, lines[0].split())
    camera_from_image = np.array([[float(x) for x in line.split()] for line in lines[1:]])
    sensor = "stereo" if camera.startswith("stereo") else camera
    x_in_image = np.linalg.solve(camera_from_image, se3(ROOT / "extrinsics" / f"{sensor}.txt") @ [*x, 1.0])
    return fx * x_in_image[0] / x_in_image[2] + cx, fy * x_in_image[1] / x_in_image[2] + cy


judge("the RobotCar SDK's projection, restated", "robotcar", pixel, file="pixels_files")
