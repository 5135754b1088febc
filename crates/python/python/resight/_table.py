"""Tables of detections in, whoever holds them: dictionaries, pandas, Polars, Arrow."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ._error import Error
from ._make import unmasked

_NEEDED = ("camera", "view", "u_px", "v_px")
_WORDS = ("camera", "view", "target", "body", "id", "corner")
_NUMBERS = ("u_px", "v_px", "x_m", "y_m", "z_m", "sigma_px", "sigma_m", "t_s")


def columns(table: Any, camera: str | None = None) -> dict[str, Any]:
    """The columns of detections as the native module takes them: lists of words, arrays of numbers, None for what is not there.

    `camera`: the name of the only camera, where no column names any.
    """
    given = given_columns(table)
    if camera is not None and "camera" not in given and "view" in given:
        given["camera"] = [camera] * len(given["view"])
    for name in _NEEDED:
        if name not in given:
            raise Error(f"detections: column {name} is missing; there are {', '.join(given)}")
    for name in given:
        if name not in _WORDS + _NUMBERS:
            raise Error(f"detections: column {name} is not known; known are {', '.join(sorted(_WORDS + _NUMBERS))}")
    found: dict[str, Any] = {name: _words(name, given[name]) if name in given else None for name in _WORDS}
    return found | {name: _numbers(name, given[name]) if name in given else None for name in _NUMBERS}


def given_columns(table: Any) -> dict[str, Any]:
    """Returns the columns of a dictionary of arrays or of a table of any library."""
    if hasattr(table, "__arrow_c_stream__") and not hasattr(table, "columns"):  # Arrow by its PyCapsule interface alone
        table = import_module("pyarrow").table(table)
    if hasattr(table, "column_names") and hasattr(table, "to_pydict"):  # pyarrow
        table = table.to_pydict()
    names = list(table.keys()) if isinstance(table, Mapping) else list(getattr(table, "columns", []))
    if not names:
        raise Error(f"detections: CSV files or a table with columns are needed, not {type(table).__name__}")
    return {str(name): table[name] for name in names}


def _words(name: str, values: Any) -> list[str | None]:
    """Returns a column of names as texts, None where one is missing."""
    array = np.asarray(values.tolist(), dtype=object) if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if array.ndim != 1:
        raise Error(f"detections: {name} has the shape {array.shape}, a column (n,) is needed")
    if array.dtype.kind in "iu":
        return [str(value) for value in array.tolist()]
    words = [_word(value) for value in array.tolist()]
    if name in _NEEDED and None in words:
        raise Error(f"detections: {name} of row {words.index(None)} is missing")
    return words


def _word(value: Any) -> str | None:
    """Returns a name as text: 3.0 of a column of numbers is `3`."""
    if value is None or type(value).__name__ == "NAType" or isinstance(value, float) and value != value:
        return None
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _numbers(name: str, values: Any) -> np.ndarray:
    """Returns a column as floating-point numbers, NaN where one is missing."""
    try:
        return np.ascontiguousarray(unmasked(name, values), dtype=np.float64)  # None becomes NaN.
    except (TypeError, ValueError) as reason:
        raise Error(f"detections: {name}: numbers are needed ({reason})") from None
