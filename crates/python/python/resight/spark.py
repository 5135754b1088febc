"""Fleets on a cluster: Apache Spark 4 or newer, and Sail, which has the same functions. The cluster's workers need this package and pyarrow.

>>> poses = resight.spark.solve(spark.read.parquet("s3a://fleet/day/"), "cameras.csv", sigma_px=0.3)
>>> moved = resight.spark.drift(poses, "cameras.csv").where("found = 'moved'")

Rows go to the workers as Arrow batches, whose doubles the kernel reads where they lie; every row of `solve` is that of `resight.batch` to the
last bit, whatever the workers, and so is every line of `drift`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from typing import Any

from . import _native
from ._columns import columns, empty_column, pyarrow
from ._error import Error
from ._fleet import FleetState

__all__ = ["drift", "locate", "solve", "states"]

_STATE = "camera string, first_s double, last_s double, state binary"
_DRIFT = "camera string, status string, found string, message string, since_s double, chi2 double, answer string"


def solve(df: Any, cameras: Any, *, target: Any = None, sigma_px: float = 0.5) -> Any:
    """Poses of the views of a DataFrame, one a row: the columns of `resight batch`, in and out.

    `cameras`: a file of cameras on the driver, or `Cameras`; `target`: a file of the points that all see. Rows keep their order within a
    partition. What is wrong with a row is its status, with a reason. Raises `Error` for columns that are missing, before any work.
    """
    known = _cameras(cameras, target)
    kinds = dict(df.dtypes)
    if "u0_px" not in kinds and "points_px" not in kinds and {"u_px", "v_px"} <= set(kinds):
        raise Error("rows of points may be split between workers: put those of a view into lists points_px and points_m first "
                    "(groupBy, collect_list), or use resight.batch on files", "input")
    _native.solve_views([(name, empty_column(name, kind)) for name, kind in df.dtypes], known, sigma_px)
    names = _output(known, "view" in kinds)
    return df.mapInArrow(partial(_solve, known.to_text(), sigma_px), names)


def locate(df: Any, cameras: Any, target: Any, *, image: str = "image") -> Any:
    """Poses from images: the target is detected and the pose solved on the workers; columns as of `solve`.

    `df` has the columns `camera`, `image` (the bytes of a PNG or JPEG, or a path that the workers can read; `image` names another column), and
    optionally `time_s` and `view`. An image that cannot be read, or does not show the target, is a row with its status and a reason.
    """
    known, shown = _cameras(cameras, None), target if isinstance(target, _native.Target) else _native.Target.read(os.fspath(target))
    kinds = dict(df.dtypes)
    missing = [name for name in ("camera", image) if name not in kinds]
    if missing:
        raise Error(f"no column `{'`, `'.join(missing)}`; the columns are {', '.join(kinds)}", "input")
    if kinds[image] not in ("binary", "string"):
        raise Error(f"column `{image}` is of type {kinds[image]}; binary (PNG or JPEG) or string (paths) is needed", "input")
    return df.mapInArrow(partial(_locate, known.to_text(), shown.to_toml(), image), _output(known, "view" in kinds))


def states(df: Any, *, period_s: float = 900.0) -> Any:
    """What is kept of each camera of a DataFrame of poses (of `solve`): one row a camera, whose `state` is `FleetState.to_bytes`.

    Each partition is summed where it lies, and what crosses the network is a few kilobytes a camera. States of other days merge with these.
    """
    partials = df.mapInArrow(partial(_sum, period_s), _STATE)
    return partials.groupBy("camera").applyInArrow(_merge, _STATE)


def drift(df: Any, cameras: Any = None, *, period_s: float = 900.0, diurnal_deg: float = 0.0, diurnal_mm: float = 0.0) -> Any:
    """What became of each camera: moved (how far, since when), dead, wrong map, …; one row a camera, the JSON line of `batch --drift` in `answer`.

    `df`: poses of `solve`, or `states`. `cameras` are those that should be there. The spans of all cameras are fetched at once, which runs
    the job as far as `states`; persist those where the poses are dear.
    """
    known = None if cameras is None else _cameras(cameras, None)
    kept = df if "state" in df.columns else states(df, period_s=period_s)
    spans = [(row[0], row[1], row[2]) for row in kept.select("camera", "first_s", "last_s").collect()]
    span = _native.fleet_span_s([(first, last) for _, first, last in spans if first is not None])
    if known is not None:
        seen = {name for name, _, _ in spans}
        empty = FleetState(period_s)
        empty.expect(name for name in known.names if name not in seen)
        rows = [(name, None, None, bytearray(state)) for name, state in empty.split().items()]
        if rows:
            kept = kept.unionByName(df.sparkSession.createDataFrame(rows, _STATE))
    text = None if known is None else known.to_text()
    return kept.mapInArrow(partial(_assess, text, span, period_s, diurnal_deg, diurnal_mm), _DRIFT)


def _cameras(cameras: Any, target: Any) -> _native.Cameras:
    """Returns the cameras of a fleet, read where a path is given."""
    if isinstance(cameras, _native.Cameras):
        if target is not None:
            raise Error("target: give it to Cameras.read", "input")
        return cameras
    shown = target if target is None or isinstance(target, _native.Target) else _native.Target.read(os.fspath(target))
    return _native.Cameras.read(os.fspath(cameras), shown)


@lru_cache(maxsize=4)
def _known(text: str) -> _native.Cameras:
    """The cameras on a worker, which lives longer than a task."""
    return _native.Cameras.parse(text)


def _output(cameras: _native.Cameras, has_view: bool) -> str:
    """The columns of poses in Spark's words."""
    given = [("camera", empty_column("camera", "string")), ("points_px", empty_column("points_px", "array<double>"))]
    view = [("view", empty_column("view", "string"))] if has_view else []
    kinds = {"camera": "string", "view": "string", "status": "string", "reason": "string", "n_points": "int"}
    names = _native.solve_views([*given, *view], cameras, 1.0).column_names
    return ", ".join(f"{name} {kinds.get(name, 'double')}" for name in names)


def _plain(table: _native.Table) -> Iterator[Any]:
    """Batches without dictionaries, which Spark does not take."""
    pa = pyarrow()
    arrow = pa.table(table)
    schema = pa.schema([pa.field(f.name, pa.string() if pa.types.is_dictionary(f.type) else f.type) for f in arrow.schema])
    yield from arrow.cast(schema).to_batches()


def _solve(cameras: str, sigma_px: float, batches: Iterator[Any]) -> Iterator[Any]:
    """Solves the views of one partition."""
    known = _known(cameras)
    for batch in batches:
        yield from _plain(_native.solve_views(columns(batch), known, sigma_px))


def _locate(cameras: str, target: str, image: str, batches: Iterator[Any]) -> Iterator[Any]:
    """Locates the images of one partition."""
    known, shown = _known(cameras), _native.Target.parse(target)
    for batch in batches:
        images = batch.column(batch.schema.get_field_index(image)).to_pylist()
        yield from _plain(_native.locate_views(columns(batch, also=[image]), images, known, shown))


def _rows(named: Iterator[tuple[str, bytes]]) -> Any:
    """Rows of `states`."""
    pa = pyarrow()
    rows = [(name, state, _native.FleetState.from_bytes(state).spans_s[0][1] or (None, None)) for name, state in named]
    return pa.RecordBatch.from_arrays([
        pa.array([name for name, _, _ in rows], pa.string()), pa.array([span[0] for _, _, span in rows], pa.float64()),
        pa.array([span[1] for _, _, span in rows], pa.float64()), pa.array([state for _, state, _ in rows], pa.binary()),
    ], names=["camera", "first_s", "last_s", "state"])


def _sum(period_s: float, batches: Iterator[Any]) -> Iterator[Any]:
    """Sums the poses of one partition to a state for each group of cameras."""
    state = FleetState(period_s)
    for batch in batches:
        state.add(batch)
    yield _rows(iter(state.split().items()))


def _merge(table: Any) -> Any:
    """Merges the states of one group of cameras."""
    parts = [FleetState.from_bytes(part) for part in table.column("state").to_pylist()]
    for other in parts[1:]:
        parts[0].merge(other)
    return pyarrow().Table.from_batches([_rows(iter(parts[0].split().items()))])


def _assess(cameras: str | None, span: tuple[float, float] | None, period_s: float, diurnal_deg: float, diurnal_mm: float,
            batches: Iterator[Any]) -> Iterator[Any]:
    """Assesses the cameras of one group."""
    known = None if cameras is None else _known(cameras)
    for batch in batches:
        state = _native.FleetState(period_s)
        for part in batch.column(batch.schema.get_field_index("state")).to_pylist():
            state.merge(_native.FleetState.from_bytes(part))
        yield _answers(state.assessed(known, span, True, None, diurnal_deg, diurnal_mm))


def _answers(lines: list[str]) -> Any:
    """Converts lines of JSON to rows of a table."""
    pa = pyarrow()
    answers = [json.loads(line) for line in lines]
    motion: Callable[[str], list[Any]] = lambda key: [(answer["motion"] or {}).get(key) for answer in answers]
    text = [pa.array([answer[key] for answer in answers], pa.string()) for key in ("camera", "status", "found", "message")]
    numbers = [pa.array(motion(key), pa.float64()) for key in ("since_s", "chi2")]
    names = ["camera", "status", "found", "message", "since_s", "chi2", "answer"]
    return pa.RecordBatch.from_arrays([*text, *numbers, pa.array(lines, pa.string())], names=names)
