"""Poses for other libraries: SciPy, pycolmap, ROS messages as dictionaries, rerun. What a function needs is imported when it is called."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ._error import Error
from ._native import Camera, Pose, PoseAnswer

__all__ = ["from_pycolmap", "from_ros", "from_scipy", "log_to_rerun", "to_pycolmap", "to_ros", "to_scipy"]


def to_scipy(pose: Pose) -> Any:
    """The rotation of b_from_a as a SciPy `Rotation`; the translation is `pose.translation_m`."""
    return import_module("scipy.spatial.transform").Rotation.from_matrix(pose.rotation)


def from_scipy(rotation: Any, translation_m: Any, *, b: str = "b", a: str = "a") -> Pose:
    """A pose of a SciPy `Rotation` and a translation (3,), metres."""
    return _pose(rotation.as_matrix(), translation_m, b, a)


def to_pycolmap(pose: Pose) -> Any:
    """A pycolmap `Rigid3d`; of cam_from_target it is pycolmap's cam_from_world. Both have the camera frame x right, y down, z forward."""
    return import_module("pycolmap").Rigid3d(pose.matrix[:3])


def from_pycolmap(rigid: Any, *, b: str = "cam", a: str = "world") -> Pose:
    """A pose of a pycolmap `Rigid3d`, whose cam_from_world is the default."""
    matrix = np.asarray(rigid.matrix(), dtype=np.float64)
    return _pose(matrix[:, :3], matrix[:, 3], b, a)


def to_ros(answer: PoseAnswer, *, frame_id: str = "target", t_s: float = 0.0) -> dict[str, Any]:
    """A `geometry_msgs/PoseWithCovarianceStamped` as a dictionary: where the camera is in the target frame.

    The covariance (36 numbers) is as ROS has it: translation first (m), then rotation about fixed axes (rad), both along the axes of `frame_id`
    and about the camera's centre. Raises `Error` of kind `request` for an answer without a pose: a message cannot say that there is none.
    """
    if answer.target_from_cam is None or answer.covariance is None:
        raise Error(f"{answer.view}: {answer.status}: {answer.message}; there is no pose to publish", "request")
    pose = answer.target_from_cam
    w, x, y, z = pose.rotation_wxyz
    place = dict(zip("xyz", (float(v) for v in pose.translation_m)))
    covariance = _of_camera_in_target(answer.covariance, pose.rotation)
    seconds = math.floor(t_s)
    stamp = {"sec": seconds, "nanosec": min(int(round((t_s - seconds) * 1e9)), 999_999_999)}
    return {
        "header": {"stamp": stamp, "frame_id": frame_id},
        "pose": {"pose": {"position": place, "orientation": {"x": x, "y": y, "z": z, "w": w}}, "covariance": covariance.ravel().tolist()},
    }


def log_to_rerun(entity: str, answer: PoseAnswer, camera: Camera | None = None) -> None:
    """Logs where the camera is to rerun at `entity`, with its pinhole where the lens has one; an answer without a pose clears it."""
    rerun = import_module("rerun")

    if answer.target_from_cam is None:
        rerun.log(entity, rerun.Clear(recursive=True))
        return
    pose = answer.target_from_cam
    rerun.log(entity, rerun.Transform3D(translation=pose.translation_m, mat3x3=pose.rotation))
    if camera is not None and camera.matrix is not None and camera.image_size_px is not None:
        rerun.log(f"{entity}/image", rerun.Pinhole(image_from_camera=camera.matrix, resolution=camera.image_size_px))


def from_ros(message: Mapping[str, Any], *, b: str = "target", a: str = "cam") -> Pose:
    """A pose of the dictionary of a ROS `Pose`, `PoseStamped` or `PoseWithCovarianceStamped`."""
    while "pose" in message:
        message = message["pose"]
    position, orientation = message["position"], message["orientation"]
    x, y, z, w = (float(orientation[key]) for key in "xyzw")
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) < 1e-3:
        raise Error(f"orientation: its length is {norm}; a rotation's is 1", "input")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    rotation = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return _pose(rotation, [float(position[key]) for key in "xyz"], b, a)


def _pose(rotation: Any, translation_m: Any, b: str, a: str) -> Pose:
    """Returns the pose of a rotation matrix and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation_m
    return Pose.from_matrix(matrix, b=b, a=a)


def _of_camera_in_target(covariance: np.ndarray, target_from_cam: np.ndarray) -> np.ndarray:
    """Of `[translation; rotation]` along the target's axes from that of `[rotation; translation]` along the camera's, where the signs of
    both change with the direction of the pose and cancel."""
    turn = np.zeros((6, 6))
    turn[:3, 3:], turn[3:, :3] = target_from_cam, target_from_cam
    rotated: np.ndarray = turn @ covariance @ turn.T
    return rotated
