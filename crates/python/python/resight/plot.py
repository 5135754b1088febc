"""Pictures of answers with Matplotlib, which `pip install resight[plot]` brings. Each draws on axes that are given, or on new ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._answer import Answer
from ._native import Camera, Pose, PoseAnswer, Target

__all__ = ["covariance_ellipse", "drift_history", "overlay", "residuals", "rig_3d"]


def _axes(axes: Any, **options: Any) -> Any:
    """Returns the given axes, or those of a new figure."""
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
    """Draws the points that the camera sees."""
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


def residuals(points_m: Any, pixels: Any, answer: PoseAnswer, camera: Camera, axes: Any = None, *, magnification: float = 50.0) -> Any:
    """Arrows from pixels (n, 2) to where the answer puts their points (n, 3), magnified; px, y down. The title says how much.

    An answer without a pose shows the pixels alone and says why in the title.
    """
    axes = _axes(axes)
    seen = np.asarray(pixels, dtype=np.float64)
    axes.plot(seen[:, 0], seen[:, 1], ".", color="tab:cyan")
    axes.set_aspect("equal")
    if not axes.yaxis_inverted():
        axes.invert_yaxis()
    axes.set_xlabel("u (px)")
    axes.set_ylabel("v (px)")
    if answer.cam_from_target is None:
        axes.set_title(f"{answer.view}: {answer.status}, {answer.message}", wrap=True)
        return axes
    points = answer.cam_from_target @ np.asarray(points_m, dtype=np.float64)
    known = np.array(camera.sees(points), dtype=bool)
    errors = camera.project(points[known]) - seen[known]
    axes.quiver(*seen[known].T, *(magnification * errors).T, angles="xy", scale_units="xy", scale=1, color="tab:red", width=0.004)
    axes.set_title(f"rms {answer.rms_px:.3f} px; arrows {magnification:g} times as long")
    return axes


def drift_history(times_s: Any, cam_from_target: Any, covariance: Any, reference: Pose, axes: Any = None, *, events: Any = ()) -> Any:
    """How far the camera has rotated (deg) and shifted (mm) from a reference through time, with the band of two standard deviations.

    `times_s` (n,), `cam_from_target` (n, 4, 4), `covariance` (n, 6, 6) of `[rotation_rad; translation_m]`; `events`: answers of `Monitor` or
    `watch`, of which those that say `drifted` are drawn as lines. Two axes are returned: rotation and translation.
    """
    from matplotlib import pyplot

    if axes is None:
        axes = pyplot.figure().subplots(2, 1, sharex=True)
    times = np.asarray(times_s, dtype=np.float64)
    matrices = np.asarray(cam_from_target, dtype=np.float64)
    old_from_new = [reference @ Pose.from_matrix(matrix, b="cam", a="target").inverse() for matrix in matrices]
    motions = np.array([np.concatenate([pose.rotation_vector, pose.translation_m]) for pose in old_from_new])
    sigmas = np.sqrt(np.diagonal(np.asarray(covariance, dtype=np.float64), axis1=1, axis2=2))
    for panel, first, scale, label in ((axes[0], 0, 180 / np.pi, "rotation (deg)"), (axes[1], 3, 1e3, "translation (mm)")):
        for k, (name, colour) in enumerate(zip("xyz", ("tab:red", "tab:green", "tab:blue"))):
            middle, sigma = scale * motions[:, first + k], scale * sigmas[:, first + k]
            panel.plot(times, middle, color=colour, label=name, linewidth=1)
            panel.fill_between(times, middle - 2 * sigma, middle + 2 * sigma, color=colour, alpha=0.15, linewidth=0)
        panel.set_ylabel(label)
        for event in events:
            if event.to_dict().get("state") == "drifted":
                panel.axvline(event["t_s"], color="black", linestyle="--", linewidth=1)
    axes[0].legend(loc="upper left", ncols=3)
    axes[1].set_xlabel("time (s)")
    return axes
