"""What `progress=True` is: a bar in the terminal, by tqdm."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from ._error import Error


def bar() -> Callable[[int, int], None]:
    """A bar that appears with the first input done. Raises `Error` of kind `input` where tqdm is not installed."""
    try:
        tqdm = import_module("tqdm.auto").tqdm
    except ImportError:
        raise Error("progress: True needs tqdm (pip install tqdm); a function progress(done, total) needs nothing", "input") from None
    shown = tqdm()

    def hear(done: int, total: int) -> None:
        shown.total = total
        shown.update(done - shown.n)
        if done == total:
            shown.close()

    return hear


def silence(_done: int, _total: int) -> None:
    """What `progress=False` is."""
