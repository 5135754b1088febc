"""The change detector for streams of poses from anywhere."""

from __future__ import annotations

import os
from typing import Any

from . import _native
from ._answer import Answer
from ._native import Pose, write_atomically


def _alarms(false_alarms_per_day: float, decision_period_s: float, stale_after_s: float, tolerance_rotation_rad: float,
            tolerance_translation_m: float) -> dict[str, float]:
    """Collects the options of a monitor under the names of the library."""
    return {"false_alarms_per_day": false_alarms_per_day, "decision_period_s": decision_period_s, "stale_after_s": stale_after_s,
            "tolerance_rotation_rad": tolerance_rotation_rad, "tolerance_translation_m": tolerance_translation_m}


class Monitor:
    """Whether a camera moved against a target, reading by reading, at a stated rate of false alarms.

    `Monitor.learn(…)` takes what it compares with from readings, `Monitor.read(…)` from a file that it or `resight watch` saved. Each answer is
    the event that `resight watch --json` prints, its `state` one of `steady`, `checking`, `drifted`, `stale`, `inconsistent`. The
    mathematics: docs/math/monitor.md.
    """

    __slots__ = ("_monitor",)

    def __init__(self, monitor: _native.Monitor) -> None:
        self._monitor = monitor

    @staticmethod
    def learn(times_s: Any, cam_from_target: Any, covariance: Any, *, false_alarms_per_day: float = 1 / 30,
              decision_period_s: float = 0.2, stale_after_s: float = 5.0, tolerance_rotation_rad: float = 0.0,
              tolerance_translation_m: float = 0.0, camera: str = "cam", target: str = "target") -> Monitor:
        """From twenty readings or more during which nothing moved.

        `times_s` (n,), seconds, never falling; `cam_from_target` (n, 4, 4); `covariance` (n, 6, 6) of `[rotation_rad; translation_m]`, camera
        frame, as of `Poses` and `PoseAnswer`. Readings within `decision_period_s` are joined to one decision; motions up to the tolerances are
        no alarm. Raises `Error` of kind `moved_while_learning` where the camera moved amid them.
        """
        alarms = _alarms(false_alarms_per_day, decision_period_s, stale_after_s, tolerance_rotation_rad, tolerance_translation_m)
        return Monitor(_native.Monitor.learned(times_s, cam_from_target, covariance, alarms, (camera, target)))

    @staticmethod
    def read(file: Any, *, t_s: float, false_alarms_per_day: float = 1 / 30, decision_period_s: float = 0.2,
             stale_after_s: float = 5.0, tolerance_rotation_rad: float = 0.0, tolerance_translation_m: float = 0.0,
             camera: str = "cam", target: str = "target") -> Monitor:
        """From a reference file of `save` or `resight watch --save-reference`; `t_s`: when the first reading is expected, seconds."""
        alarms = _alarms(false_alarms_per_day, decision_period_s, stale_after_s, tolerance_rotation_rad, tolerance_translation_m)
        return Monitor(_native.Monitor.read(os.fspath(file), t_s, alarms, (camera, target)))

    def push(self, t_s: float, pose: Any, covariance: Any = None) -> Answer:
        """The next reading, and how things stand after it.

        `pose`: a `PoseAnswer` (one without a pose counts as not seen), or cam_from_target as a `Pose` or (4, 4) with its `covariance` (6, 6).
        """
        return Answer(self._monitor.push(t_s, pose, covariance))

    def state(self, t_s: float) -> Answer:
        """How things stand at a time, also where no reading has come."""
        return Answer(self._monitor.state(t_s))

    def accept(self) -> None:
        """Takes where the camera is now for its reference, once an alarm has been looked into."""
        self._monitor.accept()

    def detectable(self, within_s: float = 60.0) -> dict[str, tuple[float, ...]] | None:
        """Sudden motions about and along x, y and z that are found within this time, nine times in ten: `rotation_rad`, `translation_m`.

        None where the noise is not yet known.
        """
        found = self._monitor.detectable(within_s)
        return None if found is None else {"rotation_rad": tuple(found[0]), "translation_m": tuple(found[1])}

    @property
    def reference(self) -> Pose:
        """cam_from_target that readings are compared with."""
        return self._monitor.reference

    def save(self, path: Any) -> None:
        """Writes the reference file, which `resight watch --reference` reads too."""
        write_atomically(path, self._monitor.to_toml())

    def __repr__(self) -> str:
        return repr(self._monitor)
