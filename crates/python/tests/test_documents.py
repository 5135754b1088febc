"""The pages for Python: every block of code runs, in order, on the files of the repository, and asserts its answer."""

import contextlib
import io
import re

import pytest

from conftest import ROOT

PAGES = ["docs/python.md", "docs/from-opencv.md", "docs/from-apriltag.md", "docs/from-colmap.md", "docs/from-kalibr.md", "docs/fleets.md", "crates/python/README.md", "README.md"]


@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_code_runs_and_asserts_its_answer(page, tmp_path, monkeypatch):
    text = (ROOT / page).read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert blocks, page
    assert all("assert " in block for block in blocks), page
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "testdata").symlink_to(ROOT / "testdata")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()):
        for block in blocks:
            exec(compile(block, page, "exec"), names)  # noqa: S102, our own page.
