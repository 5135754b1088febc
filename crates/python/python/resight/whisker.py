"""Object profiles by touch: the jobs of `resight whisker`. Lengths are metres, forces newtons, torques newton metres, angles radians.

A whisker file holds length, stiffness and noise of the instruments, hub readings are a CSV file (docs/whisker.md). Every job returns the
objects that the program prints with `--json`.
"""

from __future__ import annotations

from typing import Any

from ._answer import Answer
from ._program import _answers, _flags, _run

__all__ = ["calibrate", "check", "identify", "simulate", "solve"]


def solve(hub: Any, whisker: Any, *, output: Any = None, mode: str | None = None, mu: float | str | None = None, tare: Any = None,
          picture: Any = None) -> list[Answer]:
    """The contact of every reading with its covariance and a status, then one answer for the whole record.

    `hub`: readings, CSV or JSON Lines. `mode`: `raw` (each reading for itself), `constrained` (friction and envelope too) or `sweep`. `mu`:
    Coulomb's coefficient of friction, `auto` estimates it. `tare`: readings of the untouched whisker. `output`: also writes the contacts.
    """
    return _answers("whisker", "solve", hub, *_flags(whisker=whisker, output=output, mode=mode, mu=mu, tare=tare, picture=picture))


def identify(contacts: Any, *, output: Any = None, models: list[str] | None = None, picture: Any = None) -> Answer:
    """The object behind contacts that `solve` wrote (a circle, a polygon, …), or what is missing to name it."""
    chosen = None if models is None else ",".join(models)
    return _answers("whisker", "identify", contacts, *_flags(output=output, models=chosen, picture=picture))[0]


def calibrate(hub: Any, whisker: Any, output: Any, *, known: Any = None, known_is: str | None = None, against: Any = None) -> Answer:
    """Stiffness, zeros, gains, angles and offsets from sweeps; `output`: the whisker file with the calibration.

    `known`: the object that was touched, of which `known_is` says what is known (`place`, `size` or `kind`). `against`: an older calibration; the
    answer then says what of the rig moved since.
    """
    flags = _flags(whisker=whisker, output=output, known=known, known_is=known_is, against=against)
    return _answers("whisker", "calibrate", hub, *flags)[0]


def simulate(whisker: Any, object: Any, path: Any, output: Any, *, truth: Any = None, noise_seed: int | None = None) -> None:
    """Writes what the hub would have felt while the whisker swept over an object, and where the contacts are (`truth`)."""
    _run("whisker", "simulate", *_flags(whisker=whisker, object=object, path=path, output=output, truth=truth, noise_seed=noise_seed))


def check(contacts: Any, truth: Any) -> Answer:
    """Contacts beside the truth: errors, and whether the error bars hold."""
    return _answers("whisker", "check", contacts, truth)[0]
