"""Where cameras are, from a few known points, with the uncertainty of every answer.

>>> import resight
>>> camera = resight.read_camera("camera.yaml")
>>> answer = resight.locate_image("photo.jpg", camera, resight.read_target("tag.toml"))
>>> answer.status, answer.cam_from_target, answer.sigma_m

Poses are `b_from_a`: x_in_b = b_from_a @ x_in_a. Lengths are metres, angles radians, pixels count from the centre of the first one. A
covariance (6, 6) is that of the small motion `[rotation_rad; translation_m]` of a pose in the camera frame. Every answer has a `status`;
only `ok` may be used unseen.
"""

from . import cv as cv
from . import interop as interop
from . import spark as spark
from . import whisker as whisker
from ._answer import Answer
from ._error import Error
from ._fleet import FleetState, batch, fleet_report, solve_views
from ._jobs import (
    advise_boards,
    advise_points,
    advise_target,
    check_intrinsics,
    compare,
    detect,
    explain,
    hand_eye,
    intrinsics,
    map_tags,
    measure,
    pose_graph,
    read_camera,
    read_target,
    rig_from_detections,
    rig_from_images,
    rig_pose,
    solve_lines,
)
from ._monitor import Monitor
from ._native import (
    Camera,
    Cameras,
    Pose,
    PoseAnswer,
    Poses,
    Table,
    Target,
    __version__,
    locate_image,
    locate_images,
    solve,
    solve_many,
    solve_table,
    table,
)
from ._program import Session, convert, export_history, history, landmarks, print_target, watch

__all__ = [
    "__version__",
    "Answer",
    "Camera",
    "Cameras",
    "Error",
    "FleetState",
    "Monitor",
    "Pose",
    "PoseAnswer",
    "Poses",
    "Session",
    "Table",
    "Target",
    "advise_boards",
    "advise_points",
    "advise_target",
    "batch",
    "check_intrinsics",
    "compare",
    "convert",
    "detect",
    "explain",
    "export_history",
    "fleet_report",
    "hand_eye",
    "history",
    "intrinsics",
    "landmarks",
    "locate_image",
    "locate_images",
    "map_tags",
    "measure",
    "pose_graph",
    "print_target",
    "read_camera",
    "read_target",
    "rig_from_detections",
    "rig_from_images",
    "rig_pose",
    "solve",
    "solve_lines",
    "solve_many",
    "solve_table",
    "solve_views",
    "table",
    "watch",
]
