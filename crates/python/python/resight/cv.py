"""For people who come from OpenCV: its names and argument orders, with covariance and status.

Results are tuples as of `cv2` with attributes: `.covariance` (6, 6) of the small motion `[rotation_rad; translation_m]` of the pose in the
camera frame, `.status` and `.answer`. The first item is True only where the pose may be used: where the status is `ok`, or `ambiguous`, when
`solvePnPGeneric` lists both poses. Flags of a solver, start values and numbers of iterations are taken as `cv2` takes them, in its order, and
not needed: the solver follows from the points, all starts are searched, and samples are drawn until no larger consensus is missed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ._error import Error
from ._jobs import hand_eye, intrinsics, rig_from_detections
from ._make import unmasked
from ._native import Camera, Pose, PoseAnswer, solve

__all__ = ["Result", "Rodrigues", "calibrateCamera", "calibrateHandEye", "projectPoints", "solvePnP", "solvePnPGeneric", "solvePnPRansac",
           "stereoExtrinsics", "undistort"]

Size = tuple[int, int]


class Result(tuple[Any, ...]):
    """What OpenCV returns, and how uncertain it is: `answer`, its `status`, and the covariance (6, 6) where there is a pose."""

    answer: Any
    status: str
    covariance: np.ndarray | None

    @staticmethod
    def of(items: tuple[Any, ...], answer: Any, covariance: np.ndarray | None) -> "Result":
        """The items that cv2 returns, with these attributes."""
        result = Result(items)
        result.answer, result.status, result.covariance = answer, answer.status, covariance
        return result

    def __reduce__(self) -> tuple[Any, ...]:
        return Result.of, (tuple(self), self.answer, self.covariance)


@lru_cache(maxsize=64)
def _camera(matrix: bytes, distortion: bytes, fisheye: bool) -> Camera:
    """Returns the camera of a matrix and coefficients, given as bytes so that equal ones are built once."""
    k, d = np.frombuffer(matrix).reshape(3, 3), np.frombuffer(distortion)
    return Camera.from_matrix(k, d, fisheye=fisheye)


def _of_matrix(cameraMatrix: Any, distCoeffs: Any) -> Camera:
    """Returns the camera of OpenCV's two arrays."""
    k = _array("cameraMatrix", cameraMatrix)
    if k.shape != (3, 3):
        raise Error(f"cameraMatrix: shape {k.shape} is given, (3, 3) is needed")
    d = _array("distCoeffs", () if distCoeffs is None else distCoeffs).ravel()
    return _camera(k.tobytes(), d.tobytes(), False)


def _array(name: str, values: Any) -> np.ndarray:
    """Numbers as float64, row by row; NaN where a masked array has none."""
    try:
        return np.ascontiguousarray(unmasked(name, values), dtype=np.float64)
    except (TypeError, ValueError) as reason:
        raise Error(f"{name}: numbers are needed ({reason})") from None


def _points(name: str, values: Any, columns: int) -> np.ndarray:
    """(n, columns), (n, 1, columns) or (1, n, columns), as cv2 takes them."""
    array = _array(name, values)
    if array.ndim == 3 and 1 in array.shape[:2] and array.shape[2] == columns:
        array = array.reshape(-1, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise Error(f"{name}: shape {array.shape} is given, (n, {columns}) or (n, 1, {columns}) is needed")
    return np.ascontiguousarray(array)


def _solved(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any, **options: Any) -> PoseAnswer:
    """Returns the pose of OpenCV's four arrays."""
    points, pixels = _points("objectPoints", objectPoints, 3), _points("imagePoints", imagePoints, 2)
    return solve(points, pixels, _of_matrix(cameraMatrix, distCoeffs), **options)


def _is_usable(answer: Any) -> bool:
    """Tests whether OpenCV would return True."""
    return answer.status in ("ok", "ambiguous")


def _column(values: np.ndarray) -> np.ndarray:
    """Returns three numbers as OpenCV's (3, 1)."""
    return np.asarray(values).reshape(3, 1)


def solvePnP(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, rvec: Any = None, tvec: Any = None,
             useExtrinsicGuess: bool = False, flags: int = 0, *, sigma_px: float = 0.5) -> Result:
    """`(retval, rvec, tvec)`: the most probable pose, of three points or more in any layout. `sigma_px`: of each pixel coordinate."""
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px)
    pose = answer.cam_from_target
    if pose is None:
        return Result.of((False, None, None), answer, None)
    vectors = _column(pose.rotation_vector), _column(pose.translation_m)
    return Result.of((_is_usable(answer), *vectors), answer, answer.covariance)


def solvePnPGeneric(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, rvecs: Any = None, tvecs: Any = None,
                    useExtrinsicGuess: bool = False, flags: int = 0, rvec: Any = None, tvec: Any = None, reprojectionError: Any = None, *,
                    sigma_px: float = 0.5) -> Result:
    """`(retval, rvecs, tvecs, reprojectionError)`: every pose that fits, the most probable first, with the error of each, px."""
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px)
    minima = answer.to_dict()["minima"] or []
    kept = [k for k, minimum in enumerate(minima) if minimum["within_gate"]] if _is_usable(answer) else []
    poses = [Pose.from_matrix(minima[k]["cam_from_target"]["matrix"], b="cam", a="target") for k in kept]
    turns, shifts = [_column(p.rotation_vector) for p in poses], [_column(p.translation_m) for p in poses]
    errors = np.array([[minima[k]["rms_px"]] for k in kept], dtype=np.float64).reshape(-1, 1)
    return Result.of((len(kept), tuple(turns), tuple(shifts), errors), answer, answer.covariance)


def solvePnPRansac(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, rvec: Any = None, tvec: Any = None,
                   useExtrinsicGuess: bool = False, iterationsCount: int = 100, reprojectionError: float = 8.0, confidence: float = 0.99,
                   inliers: Any = None, flags: int = 0, *, sigma_px: float = 0.5) -> Result:
    """`(retval, rvec, tvec, inliers)`: the pose that most points agree with within `reprojectionError` px; inliers (n, 1) of int32.

    Samples are drawn until a larger consensus is missed with a probability of 1e-4, whatever `iterationsCount` and `confidence` say.
    """
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px,
                     robust_threshold_px=float(reprojectionError))
    pose = answer.cam_from_target
    if pose is None:
        return Result.of((False, None, None, None), answer, None)
    agreeing = np.array(answer.to_dict().get("inliers", []), dtype=np.int32).reshape(-1, 1)
    vectors = _column(pose.rotation_vector), _column(pose.translation_m)
    return Result.of((_is_usable(answer), *vectors, agreeing), answer, answer.covariance)


def projectPoints(objectPoints: Any, rvec: Any, tvec: Any, cameraMatrix: Any, distCoeffs: Any = None, imagePoints: Any = None,
                  jacobian: Any = None, aspectRatio: float = 0.0) -> tuple[np.ndarray, None]:
    """`(imagePoints, None)`, imagePoints (n, 1, 2); no Jacobian. Raises `Error` for a point outside the field, where cv2 folds it back."""
    points = _points("objectPoints", objectPoints, 3)
    pose = Pose.from_vectors(_array("rvec", rvec).ravel(), _array("tvec", tvec).ravel())
    pixels = _of_matrix(cameraMatrix, distCoeffs).project(pose @ points)
    return pixels.reshape(-1, 1, 2), None


def _table(objectPoints: Any, imagePoints: dict[str, Any]) -> dict[str, Any]:
    """Points of several views, one list item each, as a table of detections; `imagePoints` by the name of the camera."""
    rows: list[np.ndarray] = []
    names: dict[str, list[str]] = {"camera": [], "view": [], "id": []}
    for camera, views in imagePoints.items():
        if len(views) != len(objectPoints):
            raise Error(f"{len(objectPoints)} objectPoints and {len(views)} imagePoints{camera} are given; one item for each view is needed")
        for view, (points, pixels) in enumerate(zip(objectPoints, views)):
            places, seen = _points("objectPoints", points, 3), _points(f"imagePoints{camera}", pixels, 2)
            if len(seen) != len(places):
                raise Error(f"view {view}: {len(places)} objectPoints and {len(seen)} imagePoints{camera}")
            there = ~np.isnan(seen).all(axis=1)
            rows.append(np.hstack([places, seen])[there])
            names["camera"] += [camera] * int(there.sum())
            names["view"] += [f"{view:06}"] * int(there.sum())
            names["id"] += [str(i) for i in np.flatnonzero(there)]
    numbers = np.vstack(rows) if rows else np.zeros((0, 5))
    return names | dict(zip(("x_m", "y_m", "z_m", "u_px", "v_px"), numbers.T))


def stereoExtrinsics(objectPoints: Any, imagePoints1: Any, imagePoints2: Any, cameraMatrix1: Any, distCoeffs1: Any,
                     cameraMatrix2: Any, distCoeffs2: Any, imageSize: Size | None = None, *, sigma_px: float = 0.5) -> Result:
    """`(retval, R, T)` of `cv2.stereoCalibrate` with CALIB_FIX_INTRINSIC: x_in_2 = R x_in_1 + T; retval is the reprojection error, px.

    One list item a view. `.covariance` is that of camera 2 in camera 1. All three are None where there is no rig.
    """
    columns = _table(objectPoints, {"1": imagePoints1, "2": imagePoints2})
    cameras = {"1": _of_matrix(cameraMatrix1, distCoeffs1), "2": _of_matrix(cameraMatrix2, distCoeffs2)}
    answer = rig_from_detections(cameras, columns, sigma_px=sigma_px, reference="1")
    second = answer.to_dict().get("cameras", {}).get("2")
    if second is None or second["cam_from_rig"] is None:
        return Result.of((None, None, None), answer, None)
    pose = Pose.from_matrix(second["cam_from_rig"]["matrix"])
    covariance = second.get("covariance")
    return Result.of((answer["rms_px"], pose.rotation, _column(pose.translation_m)), answer,
                     None if covariance is None else np.array(covariance))


# Of cv2's flags for lens models: what they ask for is decided by the views, so that they change nothing here.
_CALIB_TAKEN = 1 | 16384 | 32768 | 262144  # USE_INTRINSIC_GUESS, RATIONAL_MODEL, THIN_PRISM_MODEL, TILTED_MODEL


def calibrateCamera(objectPoints: Any, imagePoints: Any, imageSize: Size, cameraMatrix: Any = None, distCoeffs: Any = None, rvecs: Any = None,
                    tvecs: Any = None, flags: int = 0, criteria: Any = None, *, sigma_px: float | None = None) -> Result:
    """`(retval, cameraMatrix, distCoeffs, rvecs, tvecs)` of views of known points, one list item a view; retval is the reprojection error, px.

    The model is `brown_conrady` with as many coefficients as the views carry, five or more in distCoeffs (1, n). The covariance of the
    intrinsics is in `.answer`. A view that took no part has None in rvecs and tvecs; all five are None where there is no camera. Raises `Error`
    for flags that fix parameters.
    """
    if flags & ~_CALIB_TAKEN:
        raise Error(f"flags: {flags} holds parameters fixed or together, which this calibration does not; leave them out")
    width_px, height_px = (int(side) for side in imageSize)
    table = _table(objectPoints, {"": imagePoints})
    answer = intrinsics(detections=table | {"camera": ["camera"] * len(table["view"])}, image_size_px=(width_px, height_px), sigma_px=sigma_px,
                        model="brown_conrady")
    found = answer.to_dict()["cameras"][0]["intrinsics"]
    if found is None:
        return Result.of((None,) * 5, answer, None)
    fx, fy, cx, cy, *coefficients = (parameter["value"] for parameter in found["parameters"])
    size = next(n for n in (5, 8, 12, 14) if len(coefficients) <= n)
    matrix, distortion = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.zeros((1, size))
    distortion[0, : len(coefficients)] = coefficients
    poses = {view["view"]: Pose.from_matrix(view["cam_from_target"]["matrix"]) for view in found["views"]}
    listed = [poses.get(f"{view:06}") for view in range(len(objectPoints))]
    turns = tuple(None if pose is None else _column(pose.rotation_vector) for pose in listed)
    shifts = tuple(None if pose is None else _column(pose.translation_m) for pose in listed)
    return Result.of((found["rms_px"], matrix, distortion, turns, shifts), answer, None)


def calibrateHandEye(R_gripper2base: Any, t_gripper2base: Any, R_target2cam: Any, t_target2cam: Any, R_cam2gripper: Any = None,
                     t_cam2gripper: Any = None, method: int = 0, *, sigma_rad: float = 1e-4, sigma_m: float = 1e-4) -> Result:
    """`(R_cam2gripper, t_cam2gripper)`: x_in_gripper = R x_in_cam + t, from poses of the gripper and of the target, one list item a view.

    `sigma_rad`, `sigma_m`: of the target's poses. What views disagree by beyond them is the robot's noise, which the views show; `method` is
    not needed. `.covariance` is that of cam_from_gripper, camera frame; both items are None where the motions do not determine it.
    """
    motions, seen = _poses("gripper2base", R_gripper2base, t_gripper2base), _poses("target2cam", R_target2cam, t_target2cam)
    covariance = np.diag([sigma_rad**2] * 3 + [sigma_m**2] * 3)
    answer = hand_eye(motions, poses=seen, poses_covariance=np.broadcast_to(covariance, (len(seen), 6, 6)))
    found = answer.to_dict().get("cam_from_gripper")
    if found is None:
        return Result.of((None, None), answer, None)
    pose = Pose.from_matrix(found["matrix"]).inverse()
    return Result.of((pose.rotation, _column(pose.translation_m)), answer, np.array(found["covariance"]))


def _poses(name: str, rotations: Any, translations: Any) -> list[Pose]:
    """One pose for each pair of a rotation (matrix, or vector) and a translation."""
    if len(rotations) != len(translations):
        raise Error(f"{len(rotations)} R_{name} and {len(translations)} t_{name} are given; one pair for each view is needed")
    return [_pose(f"R_{name}", turn, f"t_{name}", shift) for turn, shift in zip(rotations, translations)]


def _pose(name: str, turn: Any, of_shift: str, shift: Any) -> Pose:
    """Returns the pose of a rotation, as a vector or a matrix, and a translation."""
    rotation, translation = _array(name, turn), _array(of_shift, shift)
    if translation.size != 3:
        raise Error(f"{of_shift}: shape {translation.shape} is given, (3,) or (3, 1) is needed")
    if rotation.size == 3:
        return Pose.from_vectors(rotation.ravel(), translation.ravel())
    if rotation.shape != (3, 3):
        raise Error(f"{name}: shape {rotation.shape} is given, (3, 3), (3, 1) or (3,) is needed")
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation.ravel()
    return Pose.from_matrix(matrix)


def Rodrigues(src: Any, dst: Any = None, jacobian: Any = None) -> tuple[np.ndarray, None]:
    """`(dst, None)`: the rotation matrix (3, 3) of a rotation vector, or the vector (3, 1) of a matrix; no Jacobian.

    Raises `Error` for a matrix that is no rotation, which cv2 replaces by the nearest one.
    """
    pose = _pose("src", src, "t", (0.0, 0.0, 0.0))
    return (pose.rotation if np.size(src) == 3 else _column(pose.rotation_vector)), None


def undistort(src: Any, cameraMatrix: Any, distCoeffs: Any = None, dst: Any = None, newCameraMatrix: Any = None) -> np.ndarray:
    """The image (height, width) or (height, width, channels) of uint8 as a pinhole with `newCameraMatrix`, or `cameraMatrix`, takes it."""
    matrix = _array("newCameraMatrix", cameraMatrix if newCameraMatrix is None else newCameraMatrix)
    if matrix.shape != (3, 3):
        raise Error(f"newCameraMatrix: shape {matrix.shape} is given, (3, 3) is needed")
    return _of_matrix(cameraMatrix, distCoeffs).undistort(src, matrix.tolist())
