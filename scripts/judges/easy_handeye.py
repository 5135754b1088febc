"""PyYAML reads easy_handeye's file as its loaders do: frames by eye_on_hand, transformation as a TF, both key layouts."""

import ast

import numpy as np
import yaml

from _rigs import folder, judge, opencv_pixel

ours = ast.literal_eval((folder() / "mrcal" / "right.cameramodel").read_text())
fx, fy, cx, cy = ours["intrinsics"]
for name, on_hand in (("easy_handeye_base", False), ("easy_handeye_hand", True)):
    data = yaml.safe_load((folder() / name / "easy_handeye.yaml").read_text())
    for keys in (data, data["parameters"]):
        assert keys["eye_on_hand"] is on_hand and keys["tracking_base_frame"] == "right", keys
        assert keys["robot_effector_frame" if on_hand else "robot_base_frame"] == "world", keys
    tr = data["transformation"]
    w, (x, y, z) = tr["qw"], (tr["qx"], tr["qy"], tr["qz"])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    world_from_cam = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    centre = np.array([tr["x"], tr["y"], tr["z"]])
    cam_from_world = world_from_cam.T

    def pixel(camera, point):
        k = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
        return opencv_pixel(k, np.zeros(5), cam_from_world, -cam_from_world @ centre, point)

    judge(f"PyYAML {yaml.__version__}, {name}", "placed_rig", pixel, cameras=["right"])
