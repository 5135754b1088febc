"""Tables of other libraries as the columns that the kernel reads: NumPy arrays where they lie, text as numbers into a list of names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ._error import Error
from ._make import unmasked

# Columns that the kernel may read; of others only the names are handed on, for a hint where one is misspelt.
_READ = re.compile(r"camera|time_s|time|timestamp|ts|view|status|sigma_px|points_px|points_m|[uv]\d*_px|[xyz]\d*_m|cam_from_target_\w+|covariance_\d\d|probability|chi2|rms_px")
_NAMES = ("camera", "view", "status")
_PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}

Column = tuple[Any, ...]


def columns(table: Any, also: Iterable[str] = ()) -> list[tuple[str, Column]]:
    """The columns of a dictionary of arrays, or of any table with the Arrow PyCapsule interface (pyarrow, pandas, Polars, `Table`)."""
    left = set(also)
    if isinstance(table, Mapping):
        named = [(str(name), table[name]) for name in table]
        return [(name, _of_numpy(name, values)) for name, values in named if name not in left]
    arrow = _arrow(table)
    return [(name, _of_arrow(name, arrow.column(i))) for i, name in enumerate(arrow.schema.names) if name not in left]


def pyarrow() -> Any:
    """The package pyarrow, or an `Error` that says how to get it."""
    try:
        return import_module("pyarrow")
    except ImportError:
        raise Error("this needs pyarrow (pip install pyarrow); a dictionary of NumPy arrays needs nothing", "input") from None


def _arrow(table: Any) -> Any:
    """Returns a table of any library as one of Arrow."""
    pa = pyarrow()
    if isinstance(table, (pa.RecordBatch, pa.Table)):
        return table
    if hasattr(table, "__arrow_c_stream__"):
        return pa.table(table)
    raise Error(f"columns: a dictionary of arrays or a table (pyarrow, pandas, Polars) is needed, {type(table).__name__} is given", "input")


def _of_arrow(name: str, column: Any) -> Column:
    """Converts a column of Arrow; one that no reader needs is not touched."""
    pa = pyarrow()
    if not _READ.fullmatch(name):
        return ("unused",)
    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    kind = column.type
    if name in _NAMES:
        return _names_of_arrow(column)
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        return _lists_of_arrow(column)
    if pa.types.is_timestamp(kind):
        return "numbers", column.cast(pa.int64()).to_numpy(zero_copy_only=False) / _PER_SECOND[kind.unit]
    if pa.types.is_floating(kind) or pa.types.is_integer(kind):
        return "numbers", column.to_numpy(zero_copy_only=False)  # Doubles without a gap are not copied.
    raise Error(f"column `{name}` is of type {kind}; numbers are needed", "input")


def _names_of_arrow(column: Any) -> Column:
    """Converts a column of names to a dictionary and indices, -1 where a name is missing."""
    pa = pyarrow()
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    names = ["" if name is None else str(name) for name in column.dictionary.to_pylist()]
    return "names", names, column.indices.cast(pa.int32()).fill_null(-1).to_numpy(zero_copy_only=False)


def _lists_of_arrow(column: Any) -> Column:
    """Numbers side by side and where each row begins, whatever the depth; a missing list is empty."""
    pa = pyarrow()
    lengths = np.ones(len(column), dtype=np.int64)
    values, starts = column, np.arange(len(column) + 1, dtype=np.int64)
    while pa.types.is_list(values.type) or pa.types.is_large_list(values.type) or pa.types.is_fixed_size_list(values.type):
        lengths = pyarrow_compute().list_value_length(values).fill_null(0).to_numpy(zero_copy_only=False).astype(np.int64)
        starts = np.concatenate(([0], np.cumsum(lengths)))[starts]
        values = values.flatten()
    return "lists", values.to_numpy(zero_copy_only=False), np.ascontiguousarray(starts, dtype=np.int64)


def pyarrow_compute() -> Any:
    """Its functions."""
    return import_module("pyarrow.compute")


def _of_numpy(name: str, values: Any) -> Column:
    """Converts a column of NumPy or pandas; masked numbers and NaT become NaN."""
    if not _READ.fullmatch(name):
        return ("unused",)
    if name in _NAMES:
        return _names_of_numpy(name, values)
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind == "M":
        values = values.filled(np.datetime64("NaT"))
    array = unmasked(name, values)
    if array.dtype.kind == "M":
        return "numbers", np.where(np.isnat(array), np.nan, array.astype("datetime64[ns]").astype(np.int64) / 1e9)
    if array.ndim == 1:
        return "numbers", array
    width = int(np.prod(array.shape[1:]))
    return "lists", array.reshape(-1), np.arange(len(array) + 1, dtype=np.int64) * width


def _names_of_numpy(name: str, values: Any) -> Column:
    """Converts a column of names to a list of distinct ones and indices, -1 where a name is missing."""
    if hasattr(values, "categories") and hasattr(values, "codes"):  # A categorical of pandas.
        return "names", [str(x) for x in values.categories], np.asarray(values.codes, dtype=np.int32)
    if isinstance(values, str):
        raise Error(f"{name}: one name is given, one for each row is needed", "input")
    known: dict[str, int] = {}
    if isinstance(values, np.ma.MaskedArray):
        values = values.tolist()
    rows = [-1 if value is None else known.setdefault(str(value), len(known)) for value in values]
    return "names", list(known), np.asarray(rows, dtype=np.int32)


_NUMBERS = ("double", "float", "int", "bigint", "smallint", "tinyint", "decimal", "timestamp")


def empty_column(name: str, kind: str) -> Column:
    """A column without rows of a type as Spark calls it, to see whether the columns are those of views."""
    if not _READ.fullmatch(name):
        return ("unused",)
    if name in _NAMES:
        return "names", [], np.zeros(0, np.int32)
    if kind.startswith("array<"):
        return "lists", np.zeros(0), np.zeros(1, np.int64)
    if kind.startswith(_NUMBERS):
        return "numbers", np.zeros(0)
    raise Error(f"column `{name}` is of type {kind}; numbers are needed", "input")
