"""The notebook of the book, executed from its beginning; its pictures are there."""

import base64

import nbformat
from nbclient import NotebookClient

from conftest import ROOT


def test_the_notebook_runs():
    notebook = nbformat.read(ROOT / "docs/notebook.ipynb", as_version=4)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(ROOT)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    words = "".join(output.get("text", "") for output in outputs)
    pictures = [base64.b64decode(output.data["image/png"]) for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 2 and all(10_000 < len(picture) for picture in pictures)
    assert "PoseAnswer(ok" in words and "right camera at" in words
    assert "unmoved - nothing moved" in words and "undecided - something moved" in words
