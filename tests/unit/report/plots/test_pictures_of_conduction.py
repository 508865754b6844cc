"""Pictures and printed tables of a conduction against the conductivity itself."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from feti_homog import Case, run
from feti_homog.errors import CaseError
from feti_homog.report.plots import cell_picture, drawn_cell, figures, plot_helpers
from feti_homog.report.text.constant_tables import conductivity

TENSOR = [[1.0, 0.2, 0.0], [0.2, 3.0, 0.0], [0.0, 0.0, 7.0]]


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Provide the folder of a small conduction across and along the fibres, and its result."""
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
        "material": {"matrix": {"conductivity": TENSOR}, "fibre": {"conductivity": 2.0}},
        "analysis": {"type": "conductivity"},
        "output": {"pictures": False},
    }
    folder = tmp_path_factory.mktemp("conduction")
    return folder, run(Case.parse(case), MPI.COMM_SELF, out=folder)


def test_each_picture_has_the_flux_along_its_own_gradient(solved):
    folder, result = solved
    drawn = {path.name for path in figures.plot(folder)}
    assert drawn == {f"{name}.png" for name in ("cell", "partition", "mesh_error", "case_dT_dx1", "case_dT_dx2")}
    with h5py.File(folder / "result.h5") as file:
        cell = drawn_cell.DrawnCell.of(file)
        for i, state in enumerate((file["state/0"], file["state/1"])):
            (axes,) = cell_picture.deformed(cell, state, result.document, plot_helpers.PLAIN).axes
            (bar,) = axes.child_axes
            assert rf"$\partial T / \partial x_{i + 1} = 1$" in axes.get_title()
            assert bar.get_ylabel() == f"$-q_{i + 1}$ (k times gradient)"
            flux = next(shapes for shapes in axes.collections if shapes.get_array() is not None).get_array()
            weights = cell.drawn.node_areas / cell.drawn.node_areas.sum()
            assert weights @ np.ravel(flux) == pytest.approx(result.effective_conductivity[i, i], rel=0.02)


def test_a_conduction_has_no_stress_to_draw(solved):
    with pytest.raises(CaseError, match=r"--component S12: expected a stress that .* has: none; its pictures show"):
        figures.plot(solved[0], component="S12")


def test_bounds_stand_beside_the_conductivity_that_they_bound():
    k, errors = np.diag([2.0, 3.0, 9.0]) + 0.5, np.diag([0.25, 0.125, 0.0625])
    forms = {"axial": 9.5, "wiener": [1.0, 5.0], "hashin_shtrikman": [1.5, 4.5], "maxwell": 1.5}
    document = {"effective_conductivity": k, "mesh_error": {"effective_conductivity": errors}}
    first, of_mesh, bounds = conductivity(document | {"conductivity_estimates": forms})
    assert [[float(each) for each in row[1:]] for row in first.cells] == k.tolist()
    assert [[float(each) for each in row[1:]] for row in of_mesh.cells] == pytest.approx(errors, rel=0.05)
    numbers = [[float(each) for each in row[1:] if each.strip("- ")] for row in bounds.cells]
    across = [[low, k[i, i], high] for low, high in (forms["wiener"], forms["hashin_shtrikman"]) for i in (0, 1)]
    assert numbers == [[k[2, 2], 9.5], *across]
    assert [row[0] for row in bounds.cells[-2:]] == ["x1 isotropic Hashin-Shtr.", "x2 isotropic Hashin-Shtr."]
    *_, bounds = conductivity(document | {"conductivity_estimates": {"axial": 9.5, "maxwell": 2.75}})
    label, *row = bounds.cells[-1]
    assert label == "across: Maxwell" and [float(each) for each in row if each.strip("- ")] == [3.0, 2.75]
