"""The notebook of the Python interface runs as it is."""

from __future__ import annotations

import nbformat
import pytest
from nbclient import NotebookClient

from ..places import EXAMPLES

NOTEBOOK = EXAMPLES / "notebook" / "first-fit.ipynb"


@pytest.mark.slow
def test_the_notebook_runs():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    before = {path.name for path in NOTEBOOK.parent.iterdir()}
    where = {"metadata": {"path": str(NOTEBOOK.parent)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=where).execute()
    said = "".join(
        str(output.get("text") or output.get("data", {}).get("text/plain"))
        for cell in notebook.cells
        for output in cell.get("outputs", ())
    )
    assert "start 1: converged" in said and "'300 kPa': 39.8" in said
    assert {path.name for path in NOTEBOOK.parent.iterdir()} == before


def test_it_names_what_the_interface_has():
    import bubblefit

    text = NOTEBOOK.read_text()
    for name in ("read_project", "fit", "read_card", "simulate"):
        assert f"bf.{name}(" in text and name in bubblefit.__all__
