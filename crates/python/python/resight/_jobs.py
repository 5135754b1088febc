"""Jobs over several images or files, with the names of the Rust library."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from . import _native
from ._answer import Answer
from ._error import Error
from ._table import columns


def read_camera(file: Any) -> _native.Camera:
    """The camera of a file in any supported format; `FILE#NAME` picks one of several."""
    return _native.Camera.read(os.fspath(file))


def read_target(file: Any) -> _native.Target:
    """The target of a file: own TOML, Kalibr YAML or WPILib JSON."""
    return _native.Target.read(os.fspath(file))


def detect(image: Any, target: Any = None, *, family: str | None = None, corner_half_px: int | None = None,
           view: str = "image") -> Answer:
    """The points of a target in an image, or with `family` every tag of that family (`any`: of all)."""
    known = None if target is None else _target(target)
    return Answer(_native.detect(image, known, family=family, corner_half_px=corner_half_px, view=view))


def rig_from_images(cameras: Any, targets: Any, images: Mapping[str, Any], *, reference: str | None = None,
                    world: str | None = None, fixed_together: Sequence[Sequence[str]] = (),
                    known_distances_m: Sequence[tuple[str, str, float, float]] = (),
                    timestamps: Any = None, sync_tolerance_s: float | None = None,
                    joint_covariance: bool = False, corner_half_px: int | None = None,
                    progress: Any = None) -> Answer:
    """The extrinsics of several cameras from images of targets that they see together.

    `cameras`: names to cameras or files, or one file of several cameras. `targets`: one target or file, a list of them, or names to them.
    `images`: names of cameras to a pattern such as `left*.jpg`, a list of paths, or names of views to grey arrays (height, width) of uint8;
    images of one name are one view, or with `timestamps` (a CSV file of camera, frame, t_s) those within `sync_tolerance_s` of each other.
    `known_distances_m`: two cameras, the distance of their centres and its standard deviation, metres.
    `progress(done, total)` is called after each image, True is a bar by tqdm; Ctrl-C ends the work.
    """
    solving = _solving(reference, world, fixed_together, known_distances_m, joint_covariance, sync_tolerance_s)
    named, taken = (_named("cameras", cameras), _named("targets", targets)), _taken(images)
    times = None if timestamps is None else os.fspath(timestamps)
    return Answer(*_native.rig_from_images(*named, taken, solving, times, corner_half_px, progress))


def rig_from_detections(cameras: Any, detections: Any, targets: Any = (), *, sigma_px: float | None = None,
                        reference: str | None = None, world: str | None = None,
                        fixed_together: Sequence[Sequence[str]] = (),
                        known_distances_m: Sequence[tuple[str, str, float, float]] = (),
                        sync_tolerance_s: float | None = None, joint_covariance: bool = False) -> Answer:
    """The same from points that were detected already.

    `detections`: CSV files, or a table (a dictionary of columns, pandas, Polars, Arrow) with the columns camera, view, id, u_px, v_px and
    optionally target, body, corner, x_m, y_m, z_m (where no target knows the id), sigma_px, sigma_m and t_s, which `sync_tolerance_s` needs.
    """
    solving = _solving(reference, world, fixed_together, known_distances_m, joint_covariance, sync_tolerance_s)
    named = _named("cameras", cameras), _named("targets", targets)
    if _is_paths(detections):
        return Answer(*_native.rig_from_detections(*named, _paths(detections), sigma_px, solving))
    return Answer(*_native.rig_from_columns(*named, columns(detections), sigma_px, solving))


def pose_graph(file: Any, *, cameras: Any = (), reference: str | None = None, chain: bool = False, pair_sigma_rad: float | None = None,
               pair_sigma_m: float | None = None, joint_covariance: bool = False) -> Answer:
    """The extrinsics of several cameras from the relative poses of pairs of them, in a file that `resight pose-graph` reads.

    `cameras`: whose intrinsics `answer.save("rig.toml")` writes beside the poses. `chain`: the one chain of pairs of least error for each camera,
    instead of all pairs. `pair_sigma_rad`, `pair_sigma_m`: of a pair of median error, estimated from the pairs where not given.
    """
    sigmas = _both("pair_sigma_rad and pair_sigma_m", pair_sigma_rad, pair_sigma_m)
    return Answer(*_native.pose_graph(os.fspath(file), _named("cameras", cameras), reference, chain, sigmas, joint_covariance))


def hand_eye(motions: Any, *, poses: Any = None, cameras: Any = (), targets: Any = (),
             images: Mapping[str, Any] | None = None, detections: Any = None, sigma_px: float | None = None,
             reference: str | None = None, eye_to_hand: bool = False, robot_sigma_rad: float | None = None,
             robot_sigma_m: float | None = None, height_m: float | None = None, height_sigma_m: float = 1e-3,
             height_axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
             progress: Any = None) -> Answer:
    """Where a camera or rig is mounted on a robot or vehicle.

    `motions`: a CSV file of the gripper's poses as `resight hand-eye` reads it. Either `poses` (JSON Lines of `locate` or `solve`), or
    `cameras` with `targets` and `images`, or with `detections` (CSV files). `robot_sigma_rad`, `robot_sigma_m`: the robot's own noise, estimated
    from the views where not given. `height_m`: a known coordinate of the camera along `height_axis` in the gripper's frame, metres.
    """
    robot = {"eye_to_hand": eye_to_hand, "sigma_rad": robot_sigma_rad, "sigma_m": robot_sigma_m, "height_m": height_m,
             "height_sigma_m": height_sigma_m, "height_axis": tuple(height_axis)}
    if sum(given is not None for given in (poses, images, detections)) != 1:
        raise Error("one of poses, images and detections is needed")
    if poses is not None:
        return Answer(*_native.hand_eye_of_poses(os.fspath(motions), os.fspath(poses), robot))
    taken = [] if images is None else _taken(images)
    files = [] if detections is None else _paths(detections)
    named = _named("cameras", cameras), _named("targets", targets)
    solving = _solving(reference, None, (), (), False, None)
    return Answer(*_native.hand_eye(os.fspath(motions), *named, taken, files, sigma_px, solving, robot, progress))


def rig_pose(points: Any, rig: Any, *, sigma_px: float = 0.5, robust_threshold_px: float | None = None) -> list[Answer]:
    """Where a known rig is, from a CSV file of points seen by any of its cameras: one answer a view. `rig`: a file of cameras with poses."""
    lines = _native.rig_pose(os.fspath(points), os.fspath(rig), sigma_px, robust_threshold_px)
    return [Answer(line) for line in lines]


def solve_lines(file: Any, camera: Any = None, *, sigma_px: float | None = None,
                image_size_px: tuple[int, int] | None = None) -> list[Answer]:
    """Tilt, roll, heading and height from lines marked in a photograph (docs/marked-lines.md), one answer a view.

    Without a camera the focal length is estimated too, for which the size of the image is needed.
    """
    known = None if camera is None else _camera(camera)
    return [Answer(line) for line in _native.solve_lines(os.fspath(file), known, sigma_px, image_size_px)]


def advise_points(camera: Any, points: Any, *, sigma_px: float = 0.5, pose: Any = None, candidates: Any = None,
                  ground_z_m: float = 0.0, region_m: tuple[float, float, float, float] | None = None,
                  length_m: tuple[float, float, float, float] | None = None) -> list[Answer]:
    """Where the next control point should go: what is known now, then suggestions, the best first.

    `points`: a CSV file of the points measured so far. `pose`: a JSON file of about where the camera is, where they have no pixels.
    `region_m`: x0, y0, x1, y1 on the ground at `ground_z_m`; `length_m`: x1, y1, x2, y2 of a length that is to be measured there.
    """
    path = None if pose is None else os.fspath(pose)
    places = None if candidates is None else os.fspath(candidates)
    lines = _native.advise_points(_camera(camera), os.fspath(points), sigma_px, path, places, ground_z_m, region_m, length_m)
    return [Answer(line) for line in lines]


def advise_target(camera: Any, target: Any, distance_m: tuple[float, float], *,
                  tilt_deg: tuple[float, float] = (0.0, 60.0), direction_deg: tuple[float, float] = (-180.0, 180.0),
                  sigma_px: float = 0.5) -> list[Answer]:
    """How uncertain poses will be over a volume and its parts, then which change of the target helps. Ranges are from and to."""
    known = _camera(camera), _target(target)
    lines = _native.advise_target(*known, distance_m, tilt_deg, direction_deg, sigma_px)
    return [Answer(line) for line in lines]


def advise_boards(rig: Any, target: Any, distance_m: tuple[float, float], *, views: Any = None,
                  reference: str | None = None, n_boards: int = 3, sigma_px: float = 0.5) -> list[Answer]:
    """Where to show the next boards to a rig: what is known now, then one answer a board. `views`: JSON Lines of the boards seen so far."""
    path = None if views is None else os.fspath(views)
    lines = _native.advise_boards(os.fspath(rig), _target(target), distance_m, path, reference, n_boards, sigma_px)
    return [Answer(line) for line in lines]


def intrinsics(targets: Any = (), images: Any = None, *, detections: Any = None,
               image_size_px: tuple[int, int] | None = None, sigma_px: float | None = None,
               model: str = "auto",
               progress: Any = None) -> Answer:
    """Focal length, principal point and distortion of cameras with their covariance.

    `images`: a pattern or a list of one camera's, or names of cameras to them as of `rig_from_images`. Or `detections`: CSV files, with the
    size of their images. `answer.save("camera.toml")` writes cameras that may be relied on.
    """
    source = _source(targets, images, detections)
    return Answer(*_native.intrinsics(*source, image_size_px, sigma_px, model, progress))


def check_intrinsics(cameras: Any, targets: Any = (), images: Any = None, *, detections: Any = None,
                     image_size_px: tuple[int, int] | None = None, sigma_px: float | None = None,
                     progress: Any = None) -> Answer:
    """Whether existing intrinsics fit new images; arguments as of `intrinsics`."""
    source = _source(targets, images, detections)
    return Answer(*_native.check_intrinsics(_named("cameras", cameras), *source, image_size_px, sigma_px, progress))


def compare(before: Any, after: Any, *, alpha: float = 1e-3, sigma_m: float | None = None,
            sigma_rad: float | None = None) -> list[Answer]:
    """What moved between two rigs (one answer) or two files of poses (one a view). `alpha`: the chance of a false alarm."""
    sigmas = _both("sigma_m and sigma_rad", sigma_m, sigma_rad)
    lines = _native.compare(os.fspath(before), os.fspath(after), alpha, sigmas)
    return [Answer(line) for line in lines]


def measure(scene: Any) -> list[Answer]:
    """Lengths, positions, angles, areas and heights in photographs: one answer a query, then one for the whole network."""
    return [Answer(line) for line in _native.measure(os.fspath(scene))]


def explain(file: Any) -> Answer:
    """What a camera or target file means, in sentences."""
    return Answer(*_native.explain(os.fspath(file)))


def _both(names: str, first: float | None, second: float | None) -> tuple[float, float] | None:
    if (first is None) != (second is None):
        raise Error(f"{names} are needed together")
    return None if first is None or second is None else (first, second)


def _camera(value: Any) -> _native.Camera:
    return value if isinstance(value, _native.Camera) else read_camera(value)


def _target(value: Any) -> _native.Target:
    return value if isinstance(value, _native.Target) else read_target(value)


def _solving(reference: str | None, world: str | None, fixed_together: Sequence[Sequence[str]],
             known_distances_m: Sequence[tuple[str, str, float, float]], joint_covariance: bool,
             sync_tolerance_s: float | None) -> dict[str, Any]:
    return {
        "reference": reference,
        "world": world,
        "fixed_together": [list(names) for names in fixed_together],
        "known_distances_m": [tuple(distance) for distance in known_distances_m],
        "sync_tolerance_s": sync_tolerance_s,
        "joint_covariance": joint_covariance,
    }


def _named(what: str, values: Any) -> list[tuple[str | None, Any]]:
    if isinstance(values, Mapping):
        return [(str(name), value) for name, value in values.items()]
    if isinstance(values, (str, os.PathLike, _native.Camera, _native.Target)):
        return [(None, values)]
    if isinstance(values, Iterable):
        return [(None, value) for value in values]
    raise Error(f"{what}: a dictionary, a list or one of them is needed, not {type(values).__name__}")


Taken = tuple[str, str | None, str | None, Any]


def _taken(images: Mapping[str, Any]) -> list[Taken]:
    if not isinstance(images, Mapping):
        raise Error("images: a dictionary from the names of the cameras is needed")
    return [image for camera, given in images.items() for image in _of_camera(str(camera), given)]


def _of_camera(camera: str, given: Any) -> list[Taken]:
    if isinstance(given, Mapping):
        return [(camera, str(view), None, image) for view, image in given.items()]
    if isinstance(given, (str, os.PathLike)):
        pattern = os.fspath(given)
        if not any(c in pattern for c in "*?["):
            return [(camera, None, pattern, pattern)]
        paths = sorted(glob.glob(pattern))
        if not paths:
            raise Error(f"images of {camera}: no file matches {pattern}", "file")
        return [(camera, None, pattern, path) for path in paths]
    return [(camera, f"{i:06}", None, image) for i, image in enumerate(given)]


def _source(targets: Any, images: Any, detections: Any) -> tuple[list[tuple[str | None, Any]], list[Taken], list[str]]:
    if (images is None) == (detections is None):
        raise Error("either images or detections are needed")
    if images is not None and not isinstance(images, Mapping):
        images = {"camera": images}
    files = [] if detections is None else _paths(detections)
    return _named("targets", targets), [] if images is None else _taken(images), files


def _is_paths(values: Any) -> bool:
    if isinstance(values, (str, os.PathLike)):
        return True
    return isinstance(values, (list, tuple)) and all(isinstance(value, (str, os.PathLike)) for value in values)


def _paths(values: Any) -> list[str]:
    if not _is_paths(values):
        raise Error("detections: paths of CSV files are needed")
    if isinstance(values, (str, os.PathLike)):
        return [os.fspath(values)]
    return [os.fspath(value) for value in values]
