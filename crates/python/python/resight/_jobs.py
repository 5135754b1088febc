"""Jobs over several images or files, with the names of the Rust library."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from . import _native
from ._answer import Answer
from ._error import Error
from ._hand import motion_names, motions_of, seen_poses
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
                    joint_covariance: bool = False, adjust_lenses: bool = False, rolling_shutter: bool = False,
                    tolerance_rotation_rad: float | None = None, tolerance_translation_m: float | None = None,
                    corner_half_px: int | None = None, progress: Any = None) -> Answer:
    """The extrinsics of several cameras from images of targets that they see together.

    `cameras`: names to cameras or files, or one file of several cameras. `targets`: one target or file, a list of them, or names to them.
    `images`: names of cameras to a pattern such as `left*.jpg`, a path, a list of patterns, paths and arrays of uint8 (those of one place in
    the lists are one view), or names of views to arrays. Files of one name are one view, as are `left01` and `right01`; or with `timestamps` (a CSV file of camera, frame, t_s) those within `sync_tolerance_s` of each other.
    `known_distances_m`: two cameras, the distance of their centres and its standard deviation, metres.
    `adjust_lenses`: the lenses are adjusted with the rig; the covariance of a camera is what is known of its lens.
    `rolling_shutter`: the time from row to row is estimated with the cameras' time offsets; both need time stamps and a target that moves.
    `tolerance_rotation_rad`, `tolerance_translation_m`: motions of a camera up to these under another explanation of the observations do not
    make the answer inconsistent, larger ones do; where neither is given, what is within the ± does not.
    `progress(done, total)` is called after each image, True is a bar by tqdm; Ctrl-C ends the work.
    """
    solving = _solving(reference, world, fixed_together, known_distances_m, joint_covariance, sync_tolerance_s,
                       adjust_lenses, rolling_shutter, tolerance_rotation_rad, tolerance_translation_m)
    named, taken = (_named("cameras", cameras), _named("targets", targets)), _taken(images)
    times = None if timestamps is None else os.fspath(timestamps)
    return Answer(*_native.rig_from_images(*named, taken, solving, times, corner_half_px, progress))


def rig_from_detections(cameras: Any, detections: Any, targets: Any = (), *, sigma_px: float | None = None,
                        reference: str | None = None, world: str | None = None,
                        fixed_together: Sequence[Sequence[str]] = (),
                        known_distances_m: Sequence[tuple[str, str, float, float]] = (),
                        sync_tolerance_s: float | None = None, joint_covariance: bool = False,
                        adjust_lenses: bool = False, rolling_shutter: bool = False,
                        tolerance_rotation_rad: float | None = None, tolerance_translation_m: float | None = None) -> Answer:
    """The same from points that were detected already.

    `detections`: CSV files, or a table (a dictionary of columns, pandas, Polars, Arrow) with the columns camera, view, id, u_px, v_px and
    optionally target, body, corner, x_m, y_m, z_m (where no target knows the id), sigma_px, sigma_m and t_s, which `sync_tolerance_s` needs.
    """
    solving = _solving(reference, world, fixed_together, known_distances_m, joint_covariance, sync_tolerance_s,
                       adjust_lenses, rolling_shutter, tolerance_rotation_rad, tolerance_translation_m)
    named = _named("cameras", cameras), _named("targets", targets)
    return Answer(*_native.rig_from_detections(*named, _detected(detections), sigma_px, solving))


def map_tags(images: Any = (), camera: Any = None, *, detections: Any = None, family: str | None = None, size_m: float | None = None,
             sizes_m: Mapping[int, float] | None = None, known: Any = None, reference: int | None = None, sigma_px: float = 0.5,
             joint_covariance: bool = False, progress: Any = None) -> Answer:
    """A map of tags: the pose of every tag of a place, from one camera carried through it. `answer.save("map.toml")` writes the map.

    `images`: a pattern such as `walk/*.jpg`, a video, or a list of paths and arrays of uint8, in the order in which they were taken; or
    `detections`, a CSV file with the columns view, id, corner, u_px, v_px and optionally sigma_px. `size_m`: the outer edge of the black square
    of the tags, `sizes_m` that of single tags. `known`: tags with known poses, a target or its file, which determine the world; without it the
    world is the frame of the tag `reference`.
    """
    taken = [] if detections is not None else _taken({"camera": images})
    mapping = {"family": family, "size_m": size_m, "sizes_m": dict(sizes_m or {}), "reference": reference, "sigma_px": sigma_px,
               "joint_covariance": joint_covariance}
    rows = None if detections is None else os.fspath(detections)
    world = None if known is None else _target(known)
    return Answer(*_native.map_tags(_camera(camera), taken, rows, world, mapping, progress))


def pose_graph(file: Any, *, cameras: Any = (), reference: str | None = None, chain: bool = False, pair_sigma_rad: float | None = None,
               pair_sigma_m: float | None = None, joint_covariance: bool = False) -> Answer:
    """The extrinsics of several cameras from the relative poses of pairs of them, in a file that `resight pose-graph` reads.

    `cameras`: whose intrinsics `answer.save("rig.toml")` writes beside the poses. `chain`: the one chain of pairs of least error for each camera,
    instead of all pairs. `pair_sigma_rad`, `pair_sigma_m`: of a pair of median error, estimated from the pairs where not given.
    """
    sigmas = _both("pair_sigma_rad and pair_sigma_m", pair_sigma_rad, pair_sigma_m)
    return Answer(*_native.pose_graph(os.fspath(file), _named("cameras", cameras), reference, chain, sigmas, joint_covariance))


def hand_eye(motions: Any, *, cameras: Any = (), targets: Any = (), images: Any = None, detections: Any = None, poses: Any = None,
             poses_covariance: Any = None, sigma_px: float | None = None, reference: str | None = None, eye_to_hand: bool = False,
             robot_sigma_rad: float | None = None, robot_sigma_m: float | None = None, height_m: float | None = None,
             height_sigma_m: float = 1e-3, height_axis: Sequence[float] = (0.0, 0.0, 1.0),
             tolerance_rotation_rad: float | None = None, tolerance_translation_m: float | None = None,
             rotation: str | None = None, length: str | None = None, inverse: bool = False, progress: Any = None) -> Answer:
    """Where a camera or rig is mounted on a robot or vehicle.

    `motions`: the gripper's poses base_from_gripper: a file as `resight hand-eye` reads it, an array (n, 4, 4), (n, 7) or (n, 6), a list of
    `Pose`, a table with the columns of a file, or names of views to matrices or `Pose`s. `rotation` (such as "kuka"), `length` ("mm") and
    `inverse` state what files, arrays and tables do not. Samples of easy_handeye and MoveIt need nothing else. Either `poses`: JSON Lines of
    `locate` or `solve`, a file of poses cam_from_target, a list of `PoseAnswer`, or cam_from_target as of `motions` with `poses_covariance` (n, 6, 6) of the small motion `[rotation_rad; translation_m]`. Or
    `cameras` with `targets` and `images`, or with `detections` (CSV files or a table). Lists and arrays go together by place, all else by the
    name of the view. `robot_sigma_rad`, `robot_sigma_m`: the robot's own noise, estimated from the views where not given. `height_m`: a known
    coordinate of the camera along `height_axis` in the gripper's frame, metres. `tolerance_rotation_rad`, `tolerance_translation_m`: motions of camera and target up
    to these under another explanation of the views do not make the answer inconsistent, larger ones do; where neither is given, what is within
    the ± does not.
    """
    robot = {"eye_to_hand": eye_to_hand, "sigma_rad": robot_sigma_rad, "sigma_m": robot_sigma_m, "height_m": height_m,
             "height_sigma_m": height_sigma_m, "height_axis": tuple(height_axis), "tolerance_rotation_rad": tolerance_rotation_rad,
             "tolerance_translation_m": tolerance_translation_m, "rotation": rotation, "length": length, "inverse": inverse}
    if 1 < sum(given is not None for given in (poses, images, detections)):
        raise Error("one of poses, images and detections is needed")
    if images is None and detections is None:
        seen = None if poses is None else seen_poses(poses, poses_covariance, motion_names(motions))
        return Answer(*_native.hand_eye_of_poses(motions_of(motions, None), seen, robot))
    only = _only(cameras)
    if images is not None and not isinstance(images, Mapping):
        if only is None:
            raise Error("images: a dictionary from the names of the cameras is needed with several cameras")
        images = {only: images}
    taken = [] if images is None else _taken(images)
    found = None if detections is None else _detected(detections, only)
    named = _named("cameras", cameras), _named("targets", targets)
    solving = _solving(reference, None, (), (), False, None, tolerance_rotation_rad=tolerance_rotation_rad, tolerance_translation_m=tolerance_translation_m)
    gripper = motions_of(motions, _views(taken))
    return Answer(*_native.hand_eye(gripper, *named, taken, found, sigma_px, solving, robot, progress))


def _only(cameras: Any) -> str | None:
    """The name of the camera where there is one."""
    named = _named("cameras", cameras)
    if len(named) != 1:
        return None
    name, camera = named[0]
    if name is None and not isinstance(camera, _native.Camera):
        known = _native.Camera.read_all(os.fspath(camera))
        return next(iter(known)) if len(known) == 1 else None
    return name if name is not None else camera.name


def _views(taken: list[Taken]) -> list[str] | None:
    """Names of the views of one camera's images, in their order; None without images or with several cameras'."""
    if not taken or len({camera for camera, *_ in taken}) != 1:
        return None
    return [view if view is not None and not isinstance(image, (str, os.PathLike)) else os.path.splitext(os.path.basename(image))[0]
            for _, view, _, image in taken]


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

    `images`: a pattern or a list of one camera's, or names of cameras to them as of `rig_from_images`. Or `detections`: CSV files or a table
    as of `rig_from_detections` (column camera may be missing), with the size of their images. `answer.save("camera.toml")` writes cameras that may be relied on.
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
    """Returns two numbers that are given together or not at all."""
    if (first is None) != (second is None):
        raise Error(f"{names} are needed together")
    return None if first is None or second is None else (first, second)


def _camera(value: Any) -> _native.Camera:
    """Returns a camera, read where a path is given."""
    return value if isinstance(value, _native.Camera) else read_camera(value)


def _target(value: Any) -> _native.Target:
    """Returns a target, read where a path is given."""
    return value if isinstance(value, _native.Target) else read_target(value)


def _solving(reference: str | None, world: str | None, fixed_together: Sequence[Sequence[str]],
             known_distances_m: Sequence[tuple[str, str, float, float]], joint_covariance: bool,
             sync_tolerance_s: float | None, adjust_lenses: bool = False, rolling_shutter: bool = False,
             tolerance_rotation_rad: float | None = None, tolerance_translation_m: float | None = None) -> dict[str, Any]:
    """Collects the options that all functions for rigs have."""
    return {
        "reference": reference,
        "world": world,
        "fixed_together": [list(names) for names in fixed_together],
        "known_distances_m": [tuple(distance) for distance in known_distances_m],
        "sync_tolerance_s": sync_tolerance_s,
        "joint_covariance": joint_covariance,
        "adjust_lenses": adjust_lenses,
        "rolling_shutter": rolling_shutter,
        "tolerance_rotation_rad": tolerance_rotation_rad,
        "tolerance_translation_m": tolerance_translation_m,
    }


def _named(what: str, values: Any) -> list[tuple[str | None, Any]]:
    """Returns pairs of a name and a value; the name is None where none is given."""
    if isinstance(values, Mapping):
        return [(str(name), value) for name, value in values.items()]
    if isinstance(values, (str, os.PathLike, _native.Camera, _native.Target)):
        return [(None, values)]
    if isinstance(values, Iterable):
        return [(None, value) for value in values]
    raise Error(f"{what}: a dictionary, a list or one of them is needed, not {type(values).__name__}")


Taken = tuple[str, str | None, str | None, Any]


def _taken(images: Mapping[str, Any]) -> list[Taken]:
    """Returns all images of all cameras."""
    if not isinstance(images, Mapping):
        raise Error("images: a dictionary from the names of the cameras is needed")
    return [image for camera, given in images.items() for image in _of_camera(str(camera), given)]


def _of_camera(camera: str, given: Any) -> list[Taken]:
    """Returns the images of one camera, each with the name of its view or the path that states it."""
    if isinstance(given, Mapping):
        if any(isinstance(image, (str, os.PathLike)) for image in given.values()):
            raise Error(f"images of {camera}: names of views are for arrays; the view of a file is called by its name, give a list of paths")
        return [(camera, str(view), None, image) for view, image in given.items()]
    if isinstance(given, (str, os.PathLike)):
        return _files(camera, os.fspath(given))
    if isinstance(given, bytes) or _is_one_image(given):
        given = [given]
    if not isinstance(given, Iterable):
        raise Error(f"images of {camera}: a path, a pattern, a list or names of views to arrays is needed, not {type(given).__name__}")
    taken: list[Taken] = []
    for i, image in enumerate(given):
        taken += _files(camera, os.fspath(image)) if isinstance(image, (str, os.PathLike)) else [(camera, f"{i:06}", None, image)]
    return taken


def _is_one_image(given: Any) -> bool:
    """Whether an array is one image, grey or in colour; else it is several."""
    shape = getattr(given, "shape", None)
    if shape is None:
        return hasattr(given, "__array_interface__")  # An image of PIL.
    return len(shape) == 2 or len(shape) == 3 and shape[2] in (3, 4)


def _files(camera: str, pattern: str) -> list[Taken]:
    """The file of a path, or those that a pattern matches."""
    if not any(c in pattern for c in "*?[") or os.path.exists(pattern):
        return [(camera, None, None, pattern)]
    paths = sorted(glob.glob(pattern))
    if not paths:
        raise Error(f"images of {camera}: no file matches {pattern}", "file")
    return [(camera, None, pattern, path) for path in paths]


def _source(targets: Any, images: Any, detections: Any) -> tuple[list[tuple[str | None, Any]], list[Taken], Any]:
    """Returns the targets, and either images or detections, of which one is needed."""
    if (images is None) == (detections is None):
        raise Error("either images or detections are needed")
    if images is not None and not isinstance(images, Mapping):
        images = {"camera": images}
    found = None if detections is None else _detected(detections, "camera")
    return _named("targets", targets), [] if images is None else _taken(images), found


def _is_paths(values: Any) -> bool:
    """Tests whether paths are given, not a table."""
    if isinstance(values, (str, os.PathLike)):
        return True
    return isinstance(values, (list, tuple)) and all(isinstance(value, (str, os.PathLike)) for value in values)


def _detected(values: Any, camera: str | None = None) -> list[str] | dict[str, Any]:
    """Paths of files, or the columns of a table; `camera`: the name of the only one where no column names any."""
    if not _is_paths(values):
        return columns(values, camera)
    if isinstance(values, (str, os.PathLike)):
        return [os.fspath(values)]
    return [os.fspath(value) for value in values]
