"""Jobs that run in a process of their own, by the program of this package: files in, files and answers out, sessions that last."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any

from ._answer import Answer
from ._error import Error

_RUN = "import sys; from resight._native import main; sys.exit(main(sys.argv))"


def _command(words: Sequence[Any]) -> list[str]:
    """Returns the command line that runs the program in a process of its own."""
    return [sys.executable, "-c", _RUN, *(os.fspath(word) if isinstance(word, os.PathLike) else str(word) for word in words)]


def _flags(**given: Any) -> list[str]:
    """Flags of the values that are given; True is a flag alone, a list a flag with several values."""
    words: list[str] = []
    for name, value in given.items():
        if value is None or value is False:
            continue
        words.append("--" + name.rstrip("_").replace("_", "-"))
        if value is not True:
            values = value if isinstance(value, (list, tuple)) else [value]
            words.extend(os.fspath(v) if isinstance(v, os.PathLike) else str(v) for v in values)
    return words


def _refused(text: str) -> Error:
    """Returns the error that the program states."""
    said = [line for line in text.splitlines() if not line.startswith("warning: ")]
    return Error("\n".join(said).removeprefix("error: ").strip() or "the program ended without a word", "request")


def _run(*words: Any) -> str:
    """What a command prints. Raises `Error` with its words where it refuses."""
    ended = subprocess.run(_command(words), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 1, 3):
        raise _refused(ended.stderr)
    return ended.stdout


def _answers(*words: Any) -> list[Answer]:
    """The JSON lines of a command as answers."""
    return [Answer(line) for line in _run(*words, "--json").splitlines()]


def _size(pair: tuple[float, float] | None) -> str | None:
    """Writes a width and a height as the command line takes them."""
    return None if pair is None else f"{pair[0]}x{pair[1]}"


def convert(files: Any, to: str, output: Any, *, reference: str | None = None, image_size_px: tuple[int, int] | None = None,
            field_size_m: tuple[float, float] | None = None) -> Answer:
    """Writes cameras and their poses, or a tag map, in another program's format; what could not be kept is in `lost`.

    `files`: one path or several, `FILE#NAME` is one camera. `to`: `kalibr`, `opencv`, `ros`, `colmap`, `tf`, `wpilib`, …; an unknown word is an
    `Error` with all of them. `output`: a file, or a folder where the format takes several files.
    """
    given = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    flags = _flags(to=to, output=output, reference=reference, image_size_px=_size(image_size_px), field_size_m=_size(field_size_m))
    return _answers("convert", *given, *flags)[0]


def print_target(target: Any, output: Any, *, paper: str = "A4", measured_mm: tuple[float, float] | None = None,
                 measured_sigma_mm: float | None = None) -> Answer:
    """Prints a target at exact scale as PDF or SVG, by the ending of `output`.

    `target`: its file, or a dictionary of its keys (`{"kind": "tag", "family": "tag36h11", "id": 7, "size_m": 0.1}`), whose file is written too.
    `measured_mm`: lengths of the printed rulers along x and y; the target file then carries the scale of the print with its standard deviation.
    """
    keys = dict(target) if isinstance(target, dict) else {"target": target}
    x_mm, y_mm = measured_mm if measured_mm is not None else (None, None)
    flags = _flags(**keys, output=output, paper=paper, measured_x_mm=x_mm, measured_y_mm=y_mm, measured_sigma_mm=measured_sigma_mm)
    return _answers("print", *flags)[0]


def landmarks(reference: Any, images: Any, camera: Any, *, overlay: Any = None) -> list[Answer]:
    """How a camera rotated since a reference image, without any target: one answer an image.

    `reference`: a PNG or JPEG; `images`: paths or patterns; `camera`: its file; `overlay`: a folder for drawings. The scene must be far away.
    """
    given = [images] if isinstance(images, (str, os.PathLike)) else list(images)
    return _answers("landmarks", reference, *given, *_flags(camera=camera, overlay=overlay))


def history(file: Any) -> Answer:
    """Summary of a file that `watch` keeps (`history` of its session)."""
    return _answers("history", file)[0]


def export_history(file: Any, output: Any, *, events: bool = False, cameras: Sequence[str] = (), from_time: str | float | None = None,
                   to_time: str | float | None = None) -> None:
    """Writes its frames, or its events, to a CSV or Parquet file, which pandas and Polars read.

    Times: seconds, or text such as `2026-11-22T06:30:00` (UTC).
    """
    flags = _flags(export=output, events=events, from_=from_time, to=to_time)
    chosen = [word for name in cameras for word in ("--camera", name)]
    _answers("history", file, *flags, *chosen)


class Session:
    """A running session of `watch`: iterate over it for its events, or use it with `with`; leaving the block ends it."""

    def __init__(self, words: list[Any]) -> None:
        self._process = subprocess.Popen(_command(words), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.moved: bool | None = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Iterator[Answer]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            yield Answer(line.rstrip("\n"))
        assert self._process.stderr is not None
        words, status = self._process.stderr.read(), self._process.wait()
        if status not in (0, 1, 3):
            raise _refused(words)
        self.moved = status == 3

    def close(self) -> None:
        """Ends the session; what it keeps in files is whole."""
        if self._process.poll() is None:
            self._process.terminate()
        try:
            self._process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()


def watch(session: Any, *, once: bool = False, frames: bool = False) -> Session:
    """Cameras watched over time, in a process of their own: the events of a session file of `resight watch` as they happen.

    `once`: ends with its sources, and `session.moved` then says whether something moved. `frames`: also what every frame showed.

    >>> with resight.watch("session.toml") as session:
    ...     for event in session:
    ...         if event["event"] == "moved":
    ...             print(event["message"])
    """
    return Session(["watch", session, "--json", "--quiet", *_flags(once=once, frames=frames)])
