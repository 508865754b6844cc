"""ParaView's view of results: VTK's own reader finds every array, and in it the values of result.h5.

The other readers of ParaView are not in VTK's package: `scripts/paraview_check.py` tries them, and
`tests/drivers/test_paraview.py` where there is a ParaView.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support.cases import case_of
from support.ranks import parallel_assert
from support.sample_output import part_of, sample, without_interface

from feti_homog import run
from feti_homog.results import xdmf
from feti_homog.results.field_file import FieldFile

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

POLY_VERTEX, TRIANGLE, QUADRATIC_TRIANGLE = 2, 5, 22  # VTK's numbers of elements
STRAIN = [0.1, 0.0, 0.02]
VOIGT = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])
SPACE = {"S23": "column/state/K/S23", "S13": "column/state/K/S13"}
SPACE_POINTS = {"traction_a": "state/K/axial_traction", "jump_a": "state/K/axial_jump"}
CASES: dict[str, dict[str, Any]] = {
    "angle": {
        "interface": {"debonded": [{"fibre": "all"}]},
        "angle": {"values": [0, 90], "strain": STRAIN},
    },
    "space": {
        "plane": "generalized",
        "interface": {"debonded": [{"fibre": "all", "centre": 0.0, "angle": 90.0}], "contact": False},
    },
}


def written(comm: Any, directory: Path, order: int) -> Path:
    """Return the sample, written by all ranks."""
    part = part_of(sample(4, 0, order), comm.rank, comm.size)
    with FieldFile(directory, comm, part.header, part.mesh, part.fibres, part.interface) as file:
        for k, state in enumerate(part.states):
            file.write_state(k, state)
    if comm.rank == 0:
        xdmf.write(directory)
    comm.barrier()
    return directory


def computed(comm: Any, directory: Path, name: str) -> Path:
    """Return a tiny cell."""
    cell = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.25, "order": 2 if name == "angle" else 1}
    run(case_of(cell, decomposition={"subdomains": 4}, **CASES[name]), comm, out=directory)
    return directory


@pytest.mark.parametrize("order", [1, 2])
def test_a_viewer_has_all_that_ranks_wrote(comm: Any, shared_path: Path, order: int) -> None:
    folder = written(comm, shared_path, order)
    parallel_assert(comm, comm.rank > 0 or _is_all_seen(folder) == 3)


@pytest.mark.parametrize("name", CASES)
def test_a_viewer_has_all_of_a_result(comm: Any, shared_path: Path, name: str) -> None:
    folder = computed(comm, shared_path / "out", name)
    parallel_assert(comm, comm.rank > 0 or _is_all_seen(folder) >= 2)


def _is_all_seen(folder: Path) -> int:
    """Return the number of states, after all arrays of both files were compared."""
    from support.vtk_states import viewed_states

    with h5py.File(folder / "result.h5", "r") as file:
        cells, interfaces = list(viewed_states(folder / xdmf.CELL)), list(viewed_states(folder / xdmf.INTERFACE))
        assert len(cells) == len(interfaces) == len(file["state"])
        for number, (cell, interface) in enumerate(zip(cells, interfaces, strict=True)):
            _is_state(file, number, cell)
            _is_state(file, number, interface)
            _is_cell(file, number, cell)
            _is_interface(file, number, interface)
    return len(cells)


def _is_state(file: Any, number: int, seen: Any) -> None:
    """Its name, time and numbers."""
    attributes = file[f"state/{number}"].attrs
    assert (seen.label, seen.time) == (attributes["label"], number)
    assert seen.grid["label"].astype("u1").tobytes().decode().rstrip() == attributes["label"]
    assert seen.grid["load_factor"] == attributes["load_factor"]
    for name in ("strain", "stress"):
        expected = attributes[name]
        if len(expected) == 6:  # rows of the tensor, of strains with halved shears
            expected = expected[VOIGT] * (np.where(VOIGT < 3, 1.0, 0.5) if name == "strain" else 1.0)
        np.testing.assert_array_equal(seen.grid[f"mean_{name}"].ravel(), expected)
    assert "temperature" not in attributes or seen.grid["temperature"] == attributes["temperature"]


def _is_cell(file: Any, number: int, seen: Any) -> None:
    """Mesh, arrays and their places: vectors and tensors whole."""
    np.testing.assert_array_equal(seen.points[:, :2], file["mesh/points"][:])
    np.testing.assert_array_equal(seen.cells, file["mesh/triangles"][:])
    assert seen.cell_types == {TRIANGLE if seen.cells.shape[1] == 3 else QUADRATIC_TRIANGLE}
    state = file[f"state/{number}"]
    _are_equal(file, number, seen.nodes, xdmf.CELL_NODES)
    _are_equal(file, number, seen.elements, xdmf.CELL_ELEMENTS | (SPACE if "axial_stress" in state else {}))
    axial = state.get("axial_displacement", np.zeros(len(seen.points)))
    np.testing.assert_array_equal(seen.nodes["displacement"], np.column_stack([state["displacement"][:], axial]))
    _is_tensor(seen.elements["stress"], np.column_stack([state["stress"][:], state["stress_33"][:]]), state, "stress")
    for column, name in enumerate(("S11", "S22", "S12")):
        np.testing.assert_array_equal(seen.elements[name], state["stress"][:, column])


def _is_interface(file: Any, number: int, seen: Any) -> None:
    """Check a vertex at every interface node, with all arrays; warped, it stays on the cell."""
    group, state = file["interface"], file[f"state/{number}"]
    np.testing.assert_array_equal(seen.points[:, :2], group["points"][:])
    np.testing.assert_array_equal(seen.cells[:, 0], np.arange(len(seen.points)))
    assert seen.cell_types == {POLY_VERTEX} and not seen.elements
    _are_equal(file, number, seen.nodes, xdmf.INTERFACE_POINTS | (SPACE_POINTS if "axial_jump" in state else {}))
    for name in ("traction", "jump"):
        for column, direction in enumerate("nt"):
            np.testing.assert_array_equal(seen.nodes[f"{name}_{direction}"], state[name][:, column])


def _are_equal(file: Any, number: int, seen: dict[str, np.ndarray], expected: dict[str, str]) -> None:
    """Check that the arrays read are those expected, each with the values and the type of its dataset."""
    assert set(seen) == set(expected)
    for name, place in expected.items():
        table = file[place.replace("/K/", f"/{number}/")]
        assert (seen[name].dtype, seen[name].shape) == (table.dtype, table.shape), name
        np.testing.assert_array_equal(seen[name], table[:], err_msg=name)


def _is_tensor(seen: np.ndarray, components: np.ndarray, state: Any, name: str) -> None:
    """Rows of the symmetric tensor with the components 11, 22, 12, 33, and 23, 13 if the state has them."""
    whole = np.zeros((len(components), 3, 3), components.dtype)
    for column, (i, j) in enumerate(((0, 0), (1, 1), (0, 1), (2, 2))):
        whole[:, i, j] = whole[:, j, i] = components[:, column]
    for column, i in enumerate((1, 0) if f"axial_{name}" in state else ()):
        whole[:, i, 2] = whole[:, 2, i] = state[f"axial_{name}"][:, column]
    np.testing.assert_array_equal(seen, whole.reshape(-1, 9))


@pytest.mark.one_rank
def test_the_interface_moves_with_the_cell(comm: Any, shared_path: Path) -> None:
    """Displacements of both faces are those of the mesh there, and they are apart by the jump."""
    folder = computed(comm, shared_path / "out", "angle")
    parallel_assert(comm, comm.rank > 0 or _moves_with_the_cell(folder))


def _moves_with_the_cell(folder: Path) -> bool:
    with h5py.File(folder / "result.h5", "r") as file:
        group, state = file["interface"], file["state/1"]
        fibre, matrix = (state[f"displacement_{name}"][:, :2] for name in ("fibre", "matrix"))
        np.testing.assert_array_equal(fibre, state["displacement"][:][group["fibre_node"][:]])
        E11, E22, gamma12 = state.attrs["strain"]
        away = group["points"][:] - file["mesh/points"][:][group["matrix_node"][:]]
        image = away @ np.array([[E11, gamma12 / 2], [gamma12 / 2, E22]])
        size = np.abs(fibre).max()
        np.testing.assert_allclose(
            matrix, state["displacement"][:][group["matrix_node"][:]] + image, rtol=0, atol=1e-6 * size
        )
        opening = np.hypot(*(matrix - fibre).T)
        np.testing.assert_allclose(opening, np.hypot(*state["jump"][:].T), rtol=0, atol=1e-12 * size)
        np.testing.assert_allclose(state["traction_vector"][:, :2], _in_axes(group, state["traction"][:]), rtol=1e-12)
        return bool(opening.max() > 1e-3 * size)


def _in_axes(group: Any, pairs: np.ndarray) -> np.ndarray:
    normal = group["normal"][:]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return pairs[:, :1] * normal + pairs[:, 1:] * tangent


def test_without_interface_nodes_there_is_one_file(comm: Any, shared_path: Path) -> None:
    whole = without_interface(part_of(sample(4), comm.rank, comm.size))
    with FieldFile(shared_path, comm, whole.header, whole.mesh, whole.fibres, whole.interface) as file:
        file.write_state(0, whole.states[0])
    parallel_assert(comm, comm.rank > 0 or xdmf.write(shared_path) == [shared_path / "result.xdmf"])
