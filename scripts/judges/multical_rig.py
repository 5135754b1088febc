"""multical imports calibration.json (its package where installed, else its importer restated) and OpenCV projects.

The restatement of `import_pose_graph`: NAME alone is cam_from_rig; for A_to_B the pose of A is the pose of B times it.
"""

import json

import numpy as np

from _rigs import folder, judge, opencv_pixel


def restated(path):
    data = json.loads(path.read_text())
    poses, pairs = {}, {}
    for key, value in data["camera_poses"].items():
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = value["R"], value["T"]
        (pairs if "_to_" in key else poses)[key] = pose
    for key, pose in pairs.items():
        camera, master = key.split("_to_")
        poses[camera] = poses[master] @ pose
    return {name: (camera["K"], camera["dist"], poses[name]) for name, camera in data["cameras"].items()}


def imported(path):
    found = load_calibration(str(path))
    return {
        name: (camera.intrinsic, camera.dist, found.camera_poses[name]) for name, camera in found.cameras.items()
    }


try:
    from multical.io.import_calib import load_calibration

    load, program = imported, "multical"
except (ImportError, AttributeError):  # it wants names that OpenCV 5 no longer has
    load, program = restated, "multical's importer, restated"

rig = load(folder() / "multical" / "calibration.json")
judge(program, "placed_rig", lambda name, x: opencv_pixel(*rig[name][:2], rig[name][2][:3, :3], rig[name][2][:3, 3], x))

# The master's frame is left's: points go there by the poses of the other file.
pair = load(folder() / "multical_pair" / "calibration.json")
left_from_world = np.array(rig["left"][2])


def through_left(name, x):
    k, d, cam_from_left = pair[name]
    cam_from_world = np.array(cam_from_left) @ left_from_world
    return opencv_pixel(k, d, cam_from_world[:3, :3], cam_from_world[:3, 3], x)


judge(f"{program}, right_to_left", "placed_rig", through_left, cameras=["left", "right"])
