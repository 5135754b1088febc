"""Cameras and targets from keys: those of camera.toml and target.toml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ._error import Error
from ._native import Pose


def pose(matrix: Any, b: str, a: str) -> Pose:
    """What a pickled pose is made of again."""
    return Pose.from_matrix(matrix, b=b, a=a)


def _toml(value: Any, key: str) -> str:
    """Writes a value as TOML."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        if not np.isfinite(value):
            raise Error(f"{key}: {value} is not a finite number")
        return repr(float(value))
    if isinstance(value, str):
        escaped = "".join(f"\\u{ord(c):04X}" if ord(c) < 32 or c in '"\\\x7f' else c for c in value)
        return f'"{escaped}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_toml(str(k), key)} = {_toml(v, key)}" for k, v in value.items()) + " }"
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Sequence):
        return "[" + ", ".join(_toml(item, key) for item in value) + "]"
    raise Error(f"{key}: a number, a word, a list or a table is needed, not {type(value).__name__}")


def _document(keys: Mapping[str, Any]) -> str:
    """Writes keys and values as a TOML document; None is left out."""
    return "".join(f"{key} = {_toml(value, key)}\n" for key, value in keys.items() if value is not None)


def camera_text(model: str, **keys: Any) -> str:
    """A camera.toml of these keys."""
    return _document({"model": model, **{key: _float(key, value) for key, value in keys.items()}})


def _float(key: str, value: Any) -> Any:
    """Returns a whole number as a floating-point number, except for the image size."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    return float(value) if is_whole and key not in ("width_px", "height_px") else value


def target_text(kind: str, **keys: Any) -> str:
    """A target.toml of these keys."""
    return _document({"kind": kind, **keys})


def matrix_text(matrix: Any, distortion: Any, image_size_px: tuple[int, int] | None, fisheye: bool) -> str:
    """A camera.toml of OpenCV's camera matrix and distortion coefficients."""
    k = _numbers("matrix", matrix)
    if k.shape != (3, 3):
        raise Error(f"matrix: shape {k.shape} is given, (3, 3) is needed")
    if k[0, 1] != 0 or k[1, 0] != 0 or not np.array_equal(k[2], [0, 0, 1]):
        raise Error("matrix: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] is needed; no lens model here has skew")
    d = _numbers("distortion", [] if distortion is None else distortion).ravel()
    if image_size_px is None:
        return _opencv_document(k, d, fisheye)
    keys: dict[str, Any] = {"fx_px": k[0, 0], "fy_px": k[1, 1], "cx_px": k[0, 2], "cy_px": k[1, 2]}
    keys |= {"width_px": int(image_size_px[0]), "height_px": int(image_size_px[1])}
    model = "kannala_brandt" if fisheye else "brown_conrady"
    if fisheye or d.any():
        return _document({"model": model, **keys, "distortion": d})
    return _document({"model": "pinhole", **keys})


def _opencv_document(k: np.ndarray, d: np.ndarray, fisheye: bool) -> str:
    """OpenCV's own file, which need not say how large the images are."""
    def matrix(values: np.ndarray) -> str:
        rows, columns = values.shape
        data = ", ".join(_toml(value, "matrix") for value in values.ravel())
        return f"!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [{data}]\n"

    model = "camera_model: fisheye\n" if fisheye else ""
    distortion = d.reshape(-1, 1) if d.size else np.zeros((4, 1))
    return f"%YAML:1.0\n---\n{model}camera_matrix: {matrix(k)}distortion_coefficients: {matrix(distortion)}"


def unmasked(name: str, value: Any) -> np.ndarray:
    """A masked array with NaN for what is masked; any other as it is."""
    if not isinstance(value, np.ma.MaskedArray):
        return np.asarray(value)
    if value.dtype.kind not in "fiu":
        raise Error(f"{name}: numbers of dtype {value.dtype} are no real numbers; give float64")
    return np.where(value.mask, np.nan, np.asarray(value.data, dtype=np.float64))


def _numbers(name: str, value: Any) -> np.ndarray:
    """Returns an array of floating-point numbers."""
    try:
        return np.asarray(unmasked(name, value), dtype=np.float64)
    except (TypeError, ValueError) as reason:
        raise Error(f"{name}: numbers are needed ({reason})") from None
