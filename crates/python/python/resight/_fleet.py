"""Fleets: millions of views to poses, and which cameras moved."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from typing import Any

from . import _native
from ._answer import Answer
from ._columns import columns


def batch(inputs: Any, cameras: Any, output: Any, *, target: Any = None, drift: Any = None, sigma_px: float = 0.5,
          period_s: float = 900.0, threads: int = 0, progress: Any = None) -> Answer:
    """Poses of millions of views, from files to a file, on all cores and in bounded memory: what `resight batch` does.

    `inputs`: files of views (Parquet, CSV, JSON Lines), folders of them or patterns, one or several. `cameras`: a CSV table, a camera file that
    names several, or a folder of camera files. `target`: the file of the points that all see, where neither rows nor cameras state them.
    `drift`: a file for what became of each camera, as JSON Lines. `progress(rows, total)` is called after each piece (total 0: not known), True is
    a bar by tqdm. Ctrl-C ends it; the same call continues where it was.
    """
    given = _paths(inputs), os.fspath(cameras), None if target is None else os.fspath(target), os.fspath(output)
    kept = None if drift is None else os.fspath(drift)
    line, remarks = _native.batch(*given, kept, sigma_px, period_s, threads, progress)
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    return Answer(line)


def solve_views(table: Any, cameras: _native.Cameras, *, sigma_px: float = 0.5) -> _native.Table:
    """Poses of the views of a table, one a row, in its order: the kernel of `batch`.

    `table`: a dictionary of arrays or any table with the Arrow PyCapsule interface (pyarrow, pandas, Polars), with the columns of
    `resight batch`. Doubles are read where they lie, and other Python threads run meanwhile. What is wrong with a row is its status, with a
    reason. The answer goes to `pyarrow.table`, `polars.DataFrame`, `pandas.DataFrame.from_arrow`; `answer.column(name)` is a NumPy array.
    """
    return _native.solve_views(columns(table), cameras, sigma_px)


def fleet_report(inputs: Any, *, cameras: Any = None, output: Any = None, since: Any = None, state: Any = None, period_s: float = 900.0,
                 diurnal_deg: float = 0.0, diurnal_mm: float = 0.0) -> list[Answer]:
    """Which cameras moved, by how much and since when, from the poses that `batch` wrote: one answer a camera, those that moved first.

    `inputs`: Parquet files, folders of them (as Spark writes them) or patterns. `output`: a page with motions, histories, masts, map and sites.
    `state`: a file for what is kept of each camera of these poses; `since`: the one that an earlier report wrote, of the time before these
    poses: only what moved since then counts as moved.
    """
    lines = _native.fleet_report(_paths(inputs), cameras, output, since, state, period_s, diurnal_deg, diurnal_mm)
    return [Answer(line) for line in lines]


class FleetState:
    """What is kept of each camera of a fleet: exact sums over periods, which merge in any order to the same bits.

    Machines sum their own rows, hand over the bytes, and one of them merges and judges:

    >>> state = resight.FleetState()
    >>> state.add(resight.solve_views(table, cameras))
    >>> state.merge(resight.FleetState.from_bytes(of_another_machine))
    >>> [answer.camera for answer in state.assess(cameras) if answer.found == "moved"]
    """

    __slots__ = ("_state",)

    def __init__(self, period_s: float = 900.0) -> None:
        self._state = _native.FleetState(period_s)

    @staticmethod
    def from_bytes(state: bytes) -> FleetState:
        """What `to_bytes` or `split` gave, of this version. Raises `Error` of kind `request` for other bytes."""
        made = FleetState.__new__(FleetState)
        made._state = _native.FleetState.from_bytes(state)
        return made

    def to_bytes(self) -> bytes:
        """The same bytes whatever the order in which rows were added and states merged."""
        return self._state.to_bytes()

    def add(self, poses: Any) -> None:
        """Adds the rows of a table of poses, as `solve_views` and `batch` give them. Threads may add at once."""
        self._state.add_columns(columns(poses))

    def expect(self, names: Iterable[str]) -> None:
        """Adds cameras that should be there, whether they were seen or not."""
        self._state.expect(list(names))

    def merge(self, other: FleetState) -> None:
        """Adds the rows of another state, of the same period. Associative and commutative to the last bit."""
        self._state.merge(other._state)

    def split(self) -> dict[str, bytes]:
        """A state for each camera, by name; merged they are this one but for rows that name no camera."""
        return dict(self._state.split())

    def assess(self, cameras: _native.Cameras | None = None, *, output: Any = None, diurnal_deg: float = 0.0,
               diurnal_mm: float = 0.0) -> list[Answer]:
        """What became of each camera, those that moved first; `cameras` are those that should be there. `output`: a page, as of `fleet_report`."""
        page = None if output is None else os.fspath(output)
        return [Answer(line) for line in self._state.assessed(cameras, None, False, page, diurnal_deg, diurnal_mm)]

    @property
    def period_s(self) -> float:
        """Rows of a camera within so many seconds are joined to one reading."""
        return self._state.period_s

    @property
    def counts(self) -> dict[str, int]:
        """Rows by status."""
        return dict(zip(("ok", "ambiguous", "degenerate", "inconsistent", "implausible", "error"), self._state.counts))

    def __len__(self) -> int:
        return len(self._state)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FleetState) and self.to_bytes() == other.to_bytes()

    def __hash__(self) -> int:
        return hash(self.to_bytes())

    def __reduce__(self) -> tuple[Any, tuple[bytes]]:
        return FleetState.from_bytes, (self.to_bytes(),)

    def __repr__(self) -> str:
        return f"FleetState({len(self)} cameras, periods of {self.period_s:g} s)"


def _paths(given: Any) -> list[str]:
    """Returns one path or several as a list."""
    paths = [given] if isinstance(given, (str, os.PathLike)) else list(given)
    return [os.fspath(path) for path in paths]
