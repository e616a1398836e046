"""The notebooks of docs/notebooks run from the first cell to the last, and draw."""

from __future__ import annotations

import os
from pathlib import Path

import jupytext
import nbformat
import pytest
from nbclient import NotebookClient

from conftest import REPOSITORY

# Side by side with others, but one after the other: the site shows the notebooks.
pytestmark = pytest.mark.xdist_group("notebooks")

SOURCES = sorted((REPOSITORY / "docs/notebooks").glob("*.py"))


def test_there_are_notebooks() -> None:
    assert len(SOURCES) >= 6


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)
def test_notebook(source: Path, tmp_path: Path) -> None:
    notebook = jupytext.read(source)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output for output in outputs if output.get("name") == "stderr"], outputs
    # The documentation shows them as they ran here.
    out = os.environ.get("NORTHING_NOTEBOOKS")
    if out:
        Path(out).mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, Path(out, f"{source.stem}.ipynb"))
