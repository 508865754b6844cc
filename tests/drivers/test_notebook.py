"""The notebook runs from its first cell to its last, and draws."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

NOTEBOOK = Path(__file__).parents[2] / "drivers" / "notebook.ipynb"


def test_the_notebook_runs(tmp_path):
    import nbformat

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    optional = [package for package in ("pandas", "pyvista") if find_spec(package)]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2 + len(optional)
    printed = {
        cell.id: "".join(output.get("text", "") for output in cell.get("outputs", ())) for cell in notebook.cells
    }
    points = np.genfromtxt(tmp_path / "results/path/path.csv", delimiter=",", names=True, usecols=(0, 1))
    assert ("pandas" in optional) == (f"count{len(points)}." in printed["cell-10"].replace(" ", ""))
    assert ("pyvista" in optional) == (f"event {len(points) - 1} [1.]" in printed["cell-12"])
    assert any("von_mises" in output.get("text", "") for output in outputs)
    assert any("Effective stiffness" in output.get("data", {}).get("text/html", "") for output in outputs)
    assert all((tmp_path / f"results/{name}/result.json").is_file() for name in ("notebook", "path"))


def test_the_notebook_is_stored_without_results():
    import nbformat

    cells = nbformat.read(NOTEBOOK, as_version=4).cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
