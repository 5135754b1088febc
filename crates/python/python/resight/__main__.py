"""The program `resight`, as the wheel installs it."""

import os
import signal
import sys

from ._native import main as run


def main() -> int:
    """Runs the program with the arguments of this process; its exit status."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it as it ends the binary; `watch` has a handler of its own.
    os.environ.setdefault("RESIGHT_PYTHON", sys.executable)  # What `batch --engine spark` runs.
    return run(["resight", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
