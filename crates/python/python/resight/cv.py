"""For people who come from OpenCV: its names and argument orders, with covariance and status.

Results are tuples as of `cv2` with attributes: `.covariance` (6, 6) of the small motion `[rotation_rad; translation_m]` of the pose in the
camera frame, `.status` and `.answer`. The first item is True only where the pose may be used: where the status is `ok`, or `ambiguous`, when
`solvePnPGeneric` lists both poses. Flags, start values and numbers of iterations are not needed and not taken.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ._error import Error
from ._jobs import rig_from_detections
from ._native import Camera, Pose, PoseAnswer, solve

__all__ = ["Result", "projectPoints", "solvePnP", "solvePnPGeneric", "solvePnPRansac", "stereoExtrinsics"]


class Result(tuple[Any, ...]):
    """What OpenCV returns, and how uncertain it is."""

    answer: Any
    status: str
    covariance: np.ndarray | None

    @staticmethod
    def of(items: tuple[Any, ...], answer: Any, covariance: np.ndarray | None) -> "Result":
        """The items that cv2 returns, with these attributes."""
        result = Result(items)
        result.answer, result.status, result.covariance = answer, answer.status, covariance
        return result


@lru_cache(maxsize=64)
def _camera(matrix: bytes, distortion: bytes, fisheye: bool) -> Camera:
    k, d = np.frombuffer(matrix).reshape(3, 3), np.frombuffer(distortion)
    return Camera.from_matrix(k, d, fisheye=fisheye)


def _of_matrix(cameraMatrix: Any, distCoeffs: Any) -> Camera:
    k = np.ascontiguousarray(cameraMatrix, dtype=np.float64)
    if k.shape != (3, 3):
        raise Error(f"cameraMatrix: shape {k.shape} is given, (3, 3) is needed")
    d = np.ascontiguousarray([] if distCoeffs is None else distCoeffs, dtype=np.float64).ravel()
    return _camera(k.tobytes(), d.tobytes(), False)


def _points(name: str, values: Any, columns: int) -> np.ndarray:
    """(n, columns), (n, 1, columns) or (1, n, columns), as cv2 takes them."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 3 and 1 in array.shape[:2] and array.shape[2] == columns:
        array = array.reshape(-1, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise Error(f"{name}: shape {array.shape} is given, (n, {columns}) or (n, 1, {columns}) is needed")
    return np.ascontiguousarray(array)


def _solved(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any, **options: Any) -> PoseAnswer:
    points, pixels = _points("objectPoints", objectPoints, 3), _points("imagePoints", imagePoints, 2)
    return solve(points, pixels, _of_matrix(cameraMatrix, distCoeffs), **options)


def _is_usable(answer: Any) -> bool:
    return answer.status in ("ok", "ambiguous")


def _column(values: np.ndarray) -> np.ndarray:
    return np.asarray(values).reshape(3, 1)


def solvePnP(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, *,
             sigma_px: float = 0.5) -> Result:
    """`(retval, rvec, tvec)`: the most probable pose, of three points or more in any layout. `sigma_px`: of each pixel coordinate."""
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px)
    pose = answer.cam_from_target
    if pose is None:
        return Result.of((False, None, None), answer, None)
    vectors = _column(pose.rotation_vector), _column(pose.translation_m)
    return Result.of((_is_usable(answer), *vectors), answer, answer.covariance)


def solvePnPGeneric(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, *,
                    sigma_px: float = 0.5) -> Result:
    """`(retval, rvecs, tvecs, reprojectionError)`: every pose that fits, the most probable first, with the error of each, px."""
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px)
    minima = answer.to_dict()["minima"] or []
    kept = [k for k, minimum in enumerate(minima) if minimum["within_gate"]] if _is_usable(answer) else []
    poses = [Pose.from_matrix(minima[k]["cam_from_target"]["matrix"], b="cam", a="target") for k in kept]
    rvecs, tvecs = [_column(p.rotation_vector) for p in poses], [_column(p.translation_m) for p in poses]
    errors = np.array([[minima[k]["rms_px"]] for k in kept], dtype=np.float64).reshape(-1, 1)
    return Result.of((len(kept), tuple(rvecs), tuple(tvecs), errors), answer, answer.covariance)


def solvePnPRansac(objectPoints: Any, imagePoints: Any, cameraMatrix: Any, distCoeffs: Any = None, *,
                   reprojectionError: float = 8.0, sigma_px: float = 0.5) -> Result:
    """`(retval, rvec, tvec, inliers)`: the pose that most points agree with within `reprojectionError` px; inliers (n, 1) of int32."""
    answer = _solved(objectPoints, imagePoints, cameraMatrix, distCoeffs, sigma_px=sigma_px,
                     robust_threshold_px=float(reprojectionError))
    pose = answer.cam_from_target
    if pose is None:
        return Result.of((False, None, None, None), answer, None)
    inliers = np.array(answer.to_dict().get("inliers", []), dtype=np.int32).reshape(-1, 1)
    vectors = _column(pose.rotation_vector), _column(pose.translation_m)
    return Result.of((_is_usable(answer), *vectors, inliers), answer, answer.covariance)


def projectPoints(objectPoints: Any, rvec: Any, tvec: Any, cameraMatrix: Any,
                  distCoeffs: Any = None) -> tuple[np.ndarray, None]:
    """`(imagePoints, None)`, imagePoints (n, 1, 2); no Jacobian. Raises `Error` for a point outside the field, where cv2 folds it back."""
    points = _points("objectPoints", objectPoints, 3)
    pose = Pose.from_vectors(np.asarray(rvec, dtype=np.float64).ravel(), np.asarray(tvec, dtype=np.float64).ravel())
    pixels = _of_matrix(cameraMatrix, distCoeffs).project(pose @ points)
    return pixels.reshape(-1, 1, 2), None


def stereoExtrinsics(objectPoints: Any, imagePoints1: Any, imagePoints2: Any, cameraMatrix1: Any, distCoeffs1: Any,
                     cameraMatrix2: Any, distCoeffs2: Any, *, sigma_px: float = 0.5) -> Result:
    """`(retval, R, T)` of `cv2.stereoCalibrate` with CALIB_FIX_INTRINSIC: x_in_2 = R x_in_1 + T; retval is the reprojection error, px.

    One list item a view. `.covariance` is that of camera 2 in camera 1. All three are None where there is no rig.
    """
    columns: dict[str, list[Any]] = {name: [] for name in ("camera", "view", "id", "x_m", "y_m", "z_m", "u_px", "v_px")}
    if not len(objectPoints) == len(imagePoints1) == len(imagePoints2):
        raise Error("objectPoints, imagePoints1 and imagePoints2 need one item for each view")
    for view, (points, *seen) in enumerate(zip(objectPoints, imagePoints1, imagePoints2)):
        places = _points("objectPoints", points, 3)
        for camera, pixels in zip(("1", "2"), seen):
            pixels = _points(f"imagePoints{camera}", pixels, 2)
            if len(pixels) != len(places):
                raise Error(f"view {view}: {len(places)} objectPoints and {len(pixels)} imagePoints{camera}")
            for i, (place, pixel) in enumerate(zip(places, pixels)):
                values = (camera, str(view), str(i), *place, *pixel)
                for name, value in zip(columns, values):
                    columns[name].append(value)
    cameras = {"1": _of_matrix(cameraMatrix1, distCoeffs1), "2": _of_matrix(cameraMatrix2, distCoeffs2)}
    answer = rig_from_detections(cameras, columns, sigma_px=sigma_px, reference="1")
    second = answer.to_dict().get("cameras", {}).get("2")
    if second is None or second["cam_from_rig"] is None:
        return Result.of((None, None, None), answer, None)
    pose = Pose.from_matrix(second["cam_from_rig"]["matrix"])
    covariance = second.get("covariance")
    return Result.of((answer["rms_px"], pose.rotation, _column(pose.translation_m)), answer,
                     None if covariance is None else np.array(covariance))
