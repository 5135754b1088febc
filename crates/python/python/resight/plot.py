"""Pictures of answers with Matplotlib, which `pip install resight[plot]` brings. Each draws on axes that are given, or on new ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._answer import Answer
from ._native import Camera, Pose, PoseAnswer, Target

__all__ = ["covariance_ellipse", "overlay", "rig_3d"]


def _axes(axes: Any, **options: Any) -> Any:
    if axes is not None:
        return axes
    from matplotlib import pyplot

    return pyplot.figure().add_subplot(**options)


def overlay(image: Any, answer: PoseAnswer, camera: Camera, target: Target, axes: Any = None) -> Any:
    """The points of the target where the answer puts them, over the grey image (height, width), with the axes of the target frame.

    An answer without a pose shows the image alone and says why in the title. Points that the camera does not see are left out.
    """
    axes = _axes(axes)
    axes.imshow(image, cmap="gray")
    axes.set_title(f"{answer.view}: {answer.status}" + ("" if answer.cam_from_target else f", {answer.message}"), wrap=True)
    axes.set_axis_off()
    if answer.cam_from_target is None:
        return axes
    points = target.points_m
    _points(axes, camera, answer.cam_from_target @ points, "o", markerfacecolor="none", color="tab:cyan")
    length_m = 0.3 * float(np.ptp(points, axis=0).max() or 1.0)
    for axis, colour in zip(np.eye(3), ("tab:red", "tab:green", "tab:blue")):
        _points(axes, camera, answer.cam_from_target @ np.linspace(0 * axis, length_m * axis, 20), "-", color=colour, linewidth=2)
    return axes


def _points(axes: Any, camera: Camera, points_in_cam_m: np.ndarray, style: str, **options: Any) -> None:
    seen = np.array(camera.sees(points_in_cam_m), dtype=bool)
    pixels = camera.project(points_in_cam_m[seen])
    axes.plot(pixels[:, 0], pixels[:, 1], style, **options)


def covariance_ellipse(centre: Any, covariance: Any, axes: Any = None, *, n_sigma: float = 1.0, **options: Any) -> Any:
    """The ellipse of `n_sigma` standard deviations of two coordinates: centre (2,), covariance (2, 2), in the unit of the axes."""
    from matplotlib.patches import Ellipse

    axes = _axes(axes)
    variances, directions = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    width, height = 2 * n_sigma * np.sqrt(np.maximum(variances, 0.0))
    angle_deg = float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0])))
    axes.add_patch(Ellipse(tuple(centre), width, height, angle=angle_deg, **{"fill": False, **options}))
    return axes


def rig_3d(rig: Answer, axes: Any = None, *, size_m: float | None = None) -> Any:
    """The cameras of a rig's answer in its frame: centre, viewing direction (blue), right (red) and down (green), metres."""
    from matplotlib.ticker import MaxNLocator

    axes = _axes(axes, projection="3d")
    poses = {name: camera["rig_from_cam"] for name, camera in rig["cameras"].items() if camera["rig_from_cam"]}
    matrices = {name: np.array(pose["matrix"]) for name, pose in poses.items()}
    if not matrices:
        axes.set_title(rig["message"])
        return axes
    centres = np.array([matrix[:3, 3] for matrix in matrices.values()])
    length_m = size_m or 0.4 * float(np.ptp(centres, axis=0).max() or 0.1)
    for name, matrix in matrices.items():
        rig_from_cam = Pose.from_matrix(matrix, b="rig", a=name)
        for axis, colour in zip(np.eye(3), ("tab:red", "tab:green", "tab:blue")):
            ends = rig_from_cam @ np.array([0 * axis, length_m * axis])
            axes.plot(*ends.T, color=colour)
        axes.text(*matrix[:3, 3], name)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_zlabel("z (m)")
    axes.set_title(f"rig: {rig.status}")
    axes.set_aspect("equal")
    return axes
