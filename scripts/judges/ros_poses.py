"""ROS's own URDF parser reads our robot, and Python runs our launch file; both give our pixels.

The launch file runs with stand-ins for `launch` and `launch_ros` that record the nodes; their arguments are parsed as
static_transform_publisher documents them (flags with one value each). R = Rz(yaw) Ry(pitch) Rx(roll) is written out here.
"""

import argparse
import sys
import tomllib
import types

import numpy as np
from pyquaternion import Quaternion
from urdf_parser_py.urdf import URDF

from _rigs import GOLDEN as RIGS
from _rigs import folder, judge, opencv_pixel

CAMERAS = {c["name"]: c for c in tomllib.loads((RIGS.parents[1] / "placed_rig.toml").read_text())["camera"]}


def rotation_of_rpy(roll, pitch, yaw):
    turns = ([0, 0, 1], yaw), ([0, 1, 0], pitch), ([1, 0, 0], roll)
    z, y, x = (Quaternion(axis=axis, radians=angle).rotation_matrix for axis, angle in turns)
    return z @ y @ x


def judge_poses(program, world_from_frames):
    def pixel(camera, x):
        world_from_cam = world_from_frames[f"{camera}_optical_frame"]
        pose, c = np.linalg.inv(world_from_cam), CAMERAS[camera]
        k = [c["fx_px"], 0, c["cx_px"], 0, c["fy_px"], c["cy_px"], 0, 0, 1]
        return opencv_pixel(k, c.get("distortion", [0.0] * 4), pose[:3, :3], pose[:3, 3], x)

    judge(program, "placed_rig", pixel)


def check_urdf():
    robot = URDF.from_xml_file(str(folder() / "urdf" / "rig.urdf"))
    assert robot.get_root() == "world", robot.get_root()
    poses = {}
    for joint in robot.joints:
        assert (joint.type, joint.parent) == ("fixed", "world")
        pose = np.eye(4)
        pose[:3, :3] = rotation_of_rpy(*joint.origin.rpy)
        pose[:3, 3] = joint.origin.xyz
        poses[joint.child] = pose
    judge_poses("urdf_parser_py", poses)


def launched(path):
    """Arguments of every node of a launch file."""
    nodes = []
    launch, launch_ros, actions = (types.ModuleType(n) for n in ("launch", "launch_ros", "launch_ros.actions"))
    launch.LaunchDescription = list
    actions.Node = lambda **keys: nodes.append(keys)
    sys.modules |= {"launch": launch, "launch_ros": launch_ros, "launch_ros.actions": actions}
    scope = {}
    exec(compile(path.read_text(), str(path), "exec"), scope)
    scope["generate_launch_description"]()
    assert all((n["package"], n["executable"]) == ("tf2_ros", "static_transform_publisher") for n in nodes)
    return [n["arguments"] for n in nodes]


def check_launch():
    parser = argparse.ArgumentParser()
    for flag in ("x", "y", "z", "qx", "qy", "qz", "qw"):
        parser.add_argument(f"--{flag}", type=float, required=True)
    parser.add_argument("--frame-id", required=True)
    parser.add_argument("--child-frame-id", required=True)
    poses = {}
    for arguments in launched(folder() / "tf_launch" / "static_transforms.launch.py"):
        # A value that begins with a minus sign is a value to the publisher; argparse wants it tied to its flag.
        pairs = zip(arguments[::2], arguments[1::2])
        a = parser.parse_args([f"{flag}={value}" for flag, value in pairs])
        assert a.frame_id == "world"
        pose = Quaternion(a.qw, a.qx, a.qy, a.qz).transformation_matrix
        pose[:3, 3] = [a.x, a.y, a.z]
        poses[a.child_frame_id] = pose
    judge_poses("our launch file, run by Python", poses)


check_urdf()
check_launch()
