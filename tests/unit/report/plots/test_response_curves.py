"""Draw envelopes, sensitivities, stiffnesses over the debonding angle, and temperatures."""

from itertools import pairwise
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from mpi4py import MPI

from feti_homog import Case, run
from feti_homog.errors import CaseError
from feti_homog.report.plots import cell_picture, drawn_cell, figures, plot_helpers, response_curves
from feti_homog.report.plots.response_curves import envelope, modes
from feti_homog.report.text.constant_tables import conductivity


def document(factors: list[float | None], plane: tuple[str, str] = ("S22", "S12"), **shares: float) -> dict[str, Any]:
    points = [
        {"angle": 360.0 * k / len(factors)} | ({} if factor is None else {"factor": factor} | shares)
        for k, factor in enumerate(factors)
    ]
    case = {
        "name": "a", "analysis": {"plane": "strain"}, "interface": {"criterion": "max"},
        "envelope": {"plane": list(plane)}, "output": {"stress_unit": "MPa"},
    }  # fmt: skip
    return {"case": case, "envelope": points}


def curve(figure: Any) -> Any:
    (found,) = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    return found


def test_a_closed_curve_has_a_side_for_every_direction():
    figure = envelope(document([1.0, 2.0, 1.0, 2.0], normal=1.0, tangential=0.0))
    sides = np.array(curve(figure).get_segments())
    np.testing.assert_allclose(sides[:, 0], [[1, 0], [0, 2], [-1, 0], [0, -2]], atol=1e-12)
    np.testing.assert_allclose(sides[:, 1], np.roll(sides[:, 0], -1, axis=0))
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0 and axes.get_xlim()[1] > 1.0 and axes.get_ylim()[0] < -2.0
    assert axes.get_xlabel() == "$\\Sigma_{22}$ (MPa)"


def test_directions_without_an_onset_leave_a_gap():
    figure = envelope(document([1.0, None, 1.0, 2.0, 1.0], normal=1.0, tangential=0.5))
    assert len(curve(figure).get_segments()) == 3
    assert "directions without onset: 1" in figure.axes[0].get_title()


def test_far_loads_do_not_make_the_others_small():
    figure = envelope(document([1.0, 1.0, 1000.0, 1.0, 1.0], psi=45.0))
    assert abs(np.array(figure.axes[0].get_xlim())).max() < 5.0
    assert "loads up to 1000 are outside" in figure.axes[0].get_title()


@pytest.mark.parametrize("factors", [[None] * 4, [0.0] * 4])
def test_there_may_be_nothing_to_draw(factors):
    figure = envelope(document(factors, ("E11", "gamma12"), psi=0.0))
    assert figure.axes[0].get_ylabel() == "$\\gamma_{12}$"


def test_modes():
    shares = {"normal": 0.0, "tangential": 0.6, "axial": 0.8}
    assert modes(document([1.0] * 4, **shares)["envelope"]) == pytest.approx([90.0] * 4)
    assert modes(document([1.0] * 4, normal=1.0, tangential=1.0)["envelope"]) == pytest.approx([45.0] * 4)
    found = modes(document([1.0, None], psi=30.0)["envelope"])
    assert found[0] == 30.0 and np.isnan(found[1])


def test_labels_of_small_loads_do_not_overlap():
    figure = envelope(document([0.02, 0.02, 0.1, 0.1, 0.1, 0.07], normal=1.0, tangential=0.0))
    FigureCanvasAgg(figure).draw()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_xticklabels()]
    assert len(boxes) > 2
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


def test_heat_map_has_the_elasticities() -> None:
    """C11 = 3 p^2 q^0 has the elasticities 2 and 0; a constant that is zero has none."""
    found = {
        "parameters": ["material.matrix.young", "material.$.poisson"], "parameter_values": [2.0, 0.3],
        "constants": ["C11", "C12"], "constant_values": [12.0, 0.0], "derivatives": [[12.0, 0.0], [1.0, 0.0]],
    }  # fmt: skip
    picture = response_curves.sensitivities({"case": {"name": "a $"}, "sensitivities": found})
    assert picture is not None
    axes = picture.axes[0]
    assert [text.get_text() for text in axes.texts] == ["2.00", "-", "", "-"]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["C11", "C12"]
    np.testing.assert_allclose(np.ma.filled(axes.images[0].get_array(), np.nan)[:, 0], [2.0, 0.0])
    assert response_curves.sensitivities({"case": {}}) is None


@pytest.mark.parametrize(("constants", "head"), [(["C33"], "C33 (gamma12)"), (["C33", "C66"], "C33")])
def test_the_third_entry_is_a_shear_in_the_plane_alone(constants, head) -> None:
    count = len(constants)
    found = {
        "parameters": ["material.fibre.young"], "parameter_values": [2.0],
        "constants": constants, "constant_values": [1.0] * count, "derivatives": [[0.5]] * count,
    }  # fmt: skip
    picture = response_curves.sensitivities({"case": {}, "sensitivities": found})
    assert picture is not None and picture.axes[0].get_xticklabels()[0].get_text() == head


def test_angles_name_the_shear() -> None:
    points = [{"angle": angle, "stiffness": np.diag([3.0, 2.0, 1.0]).tolist()} for angle in (0.0, 90.0)]
    case = {"name": "a", "analysis": {"plane": "strain"}, "interface": {"contact": True}}
    lines = response_curves.angle({"case": case, "angle": points}).axes[0].lines[:4]
    assert [line.get_label() for line in lines] == [
        "$C_{11}$", "$C_{22}$", "$C_{12}$", r"$C_{33}$ ($\gamma_{12}$)",
    ]  # fmt: skip


def test_stiffnesses_in_space_are_relative_so_that_none_is_flat() -> None:
    first = np.arange(1.0, 37.0).reshape(6, 6)
    points = [{"angle": angle, "stiffness": (share * first).tolist()} for angle, share in ((0.0, 1.0), (90.0, 0.5))]
    case = {"name": "a", "analysis": {"plane": "generalized"}, "output": {"stress_unit": "GPa"}}
    axes = response_curves.angle({"case": case, "angle": points}).axes[0]
    assert axes.get_ylabel() == "stiffness / stiffness at 0 degrees"
    assert [line.get_label() for line in axes.lines[1:3]] == ["$C_{22}$, 8 GPa", "$C_{33}$, 15 GPa"]
    assert all(list(line.get_ydata()) == [1.0, 0.5] for line in axes.lines[:7])


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
