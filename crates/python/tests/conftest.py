"""What the tests of the package share: the repository's data, the program of the wheel, and a camera."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import resight

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch):
    """Paths are those that a person types at its root."""
    monkeypatch.chdir(ROOT)


def program(*arguments):
    """The JSON lines that the program of this wheel prints."""
    command = [os.path.join(os.path.dirname(sys.executable), "resight"), *map(str, arguments), "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert ended.returncode in (0, 1, 3), ended.stderr
    return ended.stdout.splitlines()


@pytest.fixture
def camera():
    return resight.Camera("pinhole", width_px=1280, height_px=960, fx_px=1000, fy_px=1000, cx_px=639.5, cy_px=479.5)


@pytest.fixture
def truth():
    """The pose that the pixels of `seen` are of."""
    return resight.Pose.from_vectors(np.array([0.3, -0.5, 0.1]), np.array([0.02, 0.03, 1.2]), b="cam", a="target")


POINTS_M = np.array([[0, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0, 0.15, 0]], dtype=float)


@pytest.fixture
def points_m():
    return POINTS_M.copy()


@pytest.fixture
def pixels(camera, truth, points_m):
    return camera.project(truth @ points_m)


def rows_of(page):
    """First cells of the tables of a page: what its readers come from."""
    lines = (ROOT / "docs" / page).read_text().splitlines()
    first = [re.split(r"(?<!\\)\|", line)[1].strip() for line in lines if line.startswith("| ")]
    heads = {i + 1 for i, cell in enumerate(first) if cell.startswith("---")}
    return [cell for i, cell in enumerate(first, start=1) if i not in heads and i + 1 not in heads]


class Rows:
    """Which rows of a page are run: `@rows.run("beginning of its first cell", …)` above a test, `rows.check()` in the last one."""

    def __init__(self, page):
        self.page, self.beginnings = page, []

    def run(self, *beginnings):
        def keep(test):
            self.beginnings += beginnings
            return test

        return keep

    def check(self):
        cells = rows_of(self.page)
        assert cells, self.page
        for cell in cells:
            assert any(cell.startswith(known) for known in self.beginnings), f"{self.page}: no test runs the row {cell}"
        for known in self.beginnings:
            assert any(cell.startswith(known) for cell in cells), f"{self.page}: there is no row {known}"
