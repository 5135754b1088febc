"""Answers of jobs: the JSON objects of the program, with attributes."""

from __future__ import annotations

import html
import json
import math
import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from ._error import Error
from ._native import write_atomically


class Answer:
    """The answer of a job. Its keys are those of the program's `--json`, which `resight schema` describes with their units.

    `answer.status`, `answer["status"]` and `answer.to_dict()["status"]` are the same. As attributes, lists of numbers are NumPy arrays of
    float64 and objects are answers themselves.
    """

    __slots__ = ("_json", "_keys", "_file")

    def __init__(self, text: str, file: str | None = None) -> None:
        self._json = text
        self._keys: dict[str, Any] = json.loads(text)
        self._file = file

    def to_dict(self) -> dict[str, Any]:
        """The JSON object as plain Python values; a new one at each call."""
        keys: dict[str, Any] = json.loads(self._json)
        return keys

    def to_json(self) -> str:
        """The line that the program prints with `--json`."""
        return self._json

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes what the command's `-o` writes: the TOML file of a rig or of cameras where there is one, else the JSON line.

        Raises `Error` of kind `request` for an answer without a result, which must not be taken for one.
        """
        if self._file == "":
            raise Error("a file of cameras needs the size of their images; give it with each camera", "write")
        if self.status not in ("ok", "ambiguous", "inconsistent", "implausible"):
            raise Error(f"this answer is {self.status}: {self._keys.get('message')}; nothing is written", "request")
        write_atomically(path, self._file if self._file is not None else self._json + "\n")

    @property
    def status(self) -> str:
        """`ok`, or why the answer must not be used unseen: `ambiguous`, `inconsistent`, `degenerate`, `not_found`, …"""
        return str(self._keys.get("status", self._keys.get("verdict", "ok")))

    def keys(self) -> list[str]:
        """Names of what the answer holds."""
        return list(self._keys)

    def __getitem__(self, key: str) -> Any:
        return self._keys[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __contains__(self, key: object) -> bool:
        return key in self._keys

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return _value(self._keys[name])
        except KeyError:
            known = ", ".join(self._keys)
            raise AttributeError(f"this answer has no `{name}`; it has {known}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._keys]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Answer) and self._json == other._json

    def __hash__(self) -> int:
        return hash(self._json)

    def _repr_html_(self) -> str:
        """What a notebook shows: status and sentence, the poses, and every key that is one number or word."""
        message = self._keys.get("message")
        rows = [("status", f"{self.status}: {message}" if message else self.status), *(("pose", pose) for pose in _poses(self._keys))]
        rows += [(key, str(value)) for key, value in self._keys.items() if isinstance(value, (int, float, str)) and key not in ("status", "message")]
        cells = "".join(f'<tr><th>{html.escape(key)}</th><td style="text-align:left">{html.escape(text)}</td></tr>' for key, text in rows)
        return f"<table>{cells}</table>"

    def __repr__(self) -> str:
        message = self._keys.get("message")
        parts = [f"{self.status}: {message}" if message else self.status, *_poses(self._keys), ", ".join(self._keys)]
        return f"Answer({'; '.join(parts)})"


def _poses(keys: dict[str, Any]) -> list[str]:
    """The pose of an answer, or of each camera of a rig, with its frames, each number of its translation with its standard deviation, and the largest of those of the rotation."""
    cameras = keys.get("cameras")
    parts = cameras if isinstance(cameras, dict) else {}
    words = [f"{name}: {pose}" for name, camera in parts.items() if (pose := _pose(camera))]
    own = _pose(keys)
    return ([own] if own else []) + words[:4] + ([f"{len(words) - 4} more"] if 4 < len(words) else [])


def _pose(keys: dict[str, Any]) -> str | None:
    """Returns the first pose of an answer in a line, with its own standard deviations where the answer has them."""
    for name, value in keys.items():
        if "_from_" in name and isinstance(value, dict) and "translation_m" in value:
            x, y, z = value["translation_m"]
            place = f"{name} t ({x:.4f}, {y:.4f}, {z:.4f}) m"
            if not (keys.get("sigma_translation_m") and keys.get("sigma_rad")):
                return place
            x, y, z = (1e3 * sigma_m for sigma_m in keys["sigma_translation_m"])
            return f"{place} ± ({x:.2f}, {y:.2f}, {z:.2f}) mm, rotation ± {math.degrees(max(keys['sigma_rad'])):.3f} deg"
    return None


def _value(value: Any) -> Any:
    """Converts a value of JSON: objects to answers, lists of numbers to arrays."""
    if isinstance(value, dict):
        return Answer(json.dumps(value))
    if isinstance(value, list) and value:
        if _is_numeric(value):
            return np.array(value, dtype=np.float64)
        return [_value(item) for item in value]
    return value


def _is_numeric(value: Any) -> bool:
    """Tests whether a value of JSON is a number or a regular array of numbers."""
    if not isinstance(value, list):
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    sizes = {len(item) if isinstance(item, list) else -1 for item in value}
    return len(sizes) == 1 and all(_is_numeric(item) for item in value)
