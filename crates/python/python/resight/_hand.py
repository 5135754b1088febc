"""Poses of a robot and of a target by the names of their views, whoever holds them: arrays, lists, tables, answers."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ._error import Error
from ._make import unmasked
from ._native import Pose, PoseAnswer
from ._table import given_columns


def motion_names(motions: Any) -> list[str] | None:
    """Names of the views by place, of a list or an array; None where views have names of their own."""
    return None if _is_named(motions) else [str(i) for i in range(len(motions))]


def motions_of(motions: Any, views: list[str] | None) -> Any:
    """A path, the shape and numbers of an array of rows, JSON of a table, or each view with the numbers of its pose.

    Lists and arrays of matrices take the names of `views`, or count from 0.
    """
    if isinstance(motions, (str, os.PathLike)):
        return os.fspath(motions)
    if _is_table(motions):
        return _of_table(motions)
    if isinstance(motions, Mapping):
        return [(str(view), _matrix("motions", pose)) for view, pose in motions.items()]
    if getattr(motions, "ndim", None) == 2:
        rows = np.asarray(unmasked("motions", motions), dtype=np.float64)
        return (list(rows.shape), rows.ravel().tolist())
    if views is None:
        views = [str(i) for i in range(len(motions))]
    if len(views) != len(motions):
        raise Error(f"motions: {len(motions)} poses and {len(views)} views are given; they go together by place, or give names of views")
    return [(view, _matrix("motions", pose)) for view, pose in zip(views, motions)]


def seen_poses(poses: Any, covariance: Any, views: list[str] | None) -> Any:
    """A path, each view with its answer, or with the numbers of its pose and of its covariance."""
    if isinstance(poses, (str, os.PathLike)):
        return os.fspath(poses)
    items = list(poses.items()) if isinstance(poses, Mapping) else _by_place(poses, views)
    if items and all(isinstance(pose, PoseAnswer) for _, pose in items):
        return [(str(view), pose) for view, pose in items]
    rows = unmasked("poses_covariance", () if covariance is None else covariance)
    if rows.shape != (len(items), 6, 6):
        raise Error(f"poses_covariance: shape {rows.shape} is given, ({len(items)}, 6, 6) is needed with poses that are no PoseAnswers: "
                    "of the small motion [rotation_rad; translation_m] of each, camera frame")
    return [(str(view), _matrix("poses", pose), rows[i].astype(np.float64).ravel().tolist()) for i, (view, pose) in enumerate(items)]


def _by_place(poses: Any, views: list[str] | None) -> list[tuple[str, Any]]:
    """Gives each pose the name of its view, by place, or that of its own answer."""
    if not isinstance(poses, Iterable):
        raise Error(f"poses: a path, a list or an array is needed, not {type(poses).__name__}")
    listed = list(poses)
    if views is None:
        named = [(pose.view, pose) for pose in listed if isinstance(pose, PoseAnswer)]
        if len(named) != len(listed):
            raise Error("poses: motions have names of views, so give names of views to poses, or PoseAnswers, which have them")
        return named
    if len(views) != len(listed):
        raise Error(f"{len(views)} motions and {len(listed)} poses are given; they go together by place")
    return list(zip(views, listed))


def _is_named(motions: Any) -> bool:
    """Tests whether the motions state names of views."""
    return isinstance(motions, (str, os.PathLike, Mapping)) or _is_table(motions)


def _is_table(motions: Any) -> bool:
    """Tests whether the motions are a table of columns, not a dictionary of poses."""
    if isinstance(motions, Mapping):
        return bool(motions) and all(np.ndim(column) == 1 for column in motions.values())
    return any(hasattr(motions, name) for name in ("columns", "column_names"))


def _of_table(table: Any) -> tuple[str]:
    """The rows of a table as JSON, which is read as the rows of a file."""
    given = {str(name): np.asarray(unmasked(str(name), column)).tolist() for name, column in given_columns(table).items()}
    if len({len(column) for column in given.values()}) > 1:
        raise Error("motions: columns of one length are needed")
    rows = [dict(zip(given, row)) for row in zip(*given.values())]
    try:
        return (json.dumps(rows, allow_nan=False, default=str),)
    except ValueError:
        raise Error("motions: a number is not finite") from None


def _matrix(what: str, pose: Any) -> list[float]:
    """Returns the 16 numbers of a pose, row by row."""
    if isinstance(pose, Pose):
        pose = pose.matrix
    try:
        matrix = np.asarray(unmasked(what, pose), dtype=np.float64)
    except (TypeError, ValueError):
        raise Error(f"{what}: a Pose or a matrix (4, 4) is needed for each view, not {type(pose).__name__}") from None
    if matrix.shape != (4, 4):
        raise Error(f"{what}: a matrix of shape {matrix.shape} is given, (4, 4) is needed for each view")
    numbers: list[float] = matrix.ravel().tolist()
    return numbers
