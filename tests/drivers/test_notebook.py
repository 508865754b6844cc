"""The notebook runs from its first cell to its last, and draws."""

from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

NOTEBOOK = Path(__file__).parents[2] / "drivers" / "notebook.ipynb"


def test_the_notebook_runs(tmp_path):
    import nbformat

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    assert any("von_mises" in output.get("text", "") for output in outputs)
    assert any("Effective stiffness" in output.get("data", {}).get("text/html", "") for output in outputs)
    assert (tmp_path / "results/notebook/result.json").is_file()


def test_the_notebook_is_stored_without_results():
    import nbformat

    cells = nbformat.read(NOTEBOOK, as_version=4).cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
