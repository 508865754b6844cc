"""Fields that follow from those of result.h5: by the independent elements and laws of `verify`, and in files of VTK."""

import errno
import os
import shutil
from xml.etree import ElementTree

import h5py
import meshio
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

from feti_homog import Case, read_state
from feti_homog.cli import main
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.materials.laws import out_of_plane
from feti_homog.results import viewed_states
from feti_homog.verify.constitutive_law import VOIGT
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.reading import opened

pytestmark = pytest.mark.slow

KINDS = {"plane": 1, "contact": 2, "spatial contact": 13}  # kinds of results, and a state of each


def strain_33(case, state, mesh, phases):
    """Return what the program's own laws of the materials make of the stresses."""
    if len(state.strain) == 6:
        return np.full(len(state.stress), state.strain[2])
    rules = np.array([out_of_plane(case.material_of(name), case.analysis.plane)[1] for name in phases])
    return (rules[mesh.phase] * state.stress).sum(axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_fields_that_follow_are_those_of_other_elements(results, kind):
    seen = read_state(results(kind), KINDS[kind])
    with opened(results(kind)) as files:
        cell, state = DiscreteCell.of(files), list(files.states())[KINDS[kind]]
        E33 = strain_33(Case.parse(files.case), state, files.mesh, files.phases)
    u = state.displacement
    strain = cell.elements.fields(u, np.abs(u), state.along, state.temperature * cell.expansions).strain
    components = np.zeros((len(strain), 6))
    components[:, [0, 1, 5]] = strain[:, [0, 1, -1]]
    components[:, 2] = E33
    if len(state.strain) == 6:
        components[:, 3:5] = strain[:, 3:5]
    tensors = components[:, VOIGT[6]] * np.where(np.eye(3) > 0, 1.0, 0.5)
    np.testing.assert_allclose(seen.elements["strain"].reshape(-1, 3, 3), tensors, atol=1e-12 * np.abs(tensors).max())
    stress = seen.elements["stress"].reshape(-1, 3, 3)
    np.testing.assert_array_equal(stress[:, 2, 2], state.stress_33)
    principal = np.column_stack([seen.elements[f"principal_{k}"] for k in (3, 2, 1)])
    size = np.abs(stress).max()
    np.testing.assert_allclose(principal, np.linalg.eigvalsh(stress), atol=1e-13 * size)
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    mises = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    np.testing.assert_allclose(seen.elements["von_mises"], mises, atol=1e-13 * size)
    columns = state.fluctuation.shape[1]
    np.testing.assert_allclose(seen.nodes["fluctuation"][:, :columns], state.fluctuation, atol=1e-14 * np.abs(u).max())
    assert seen.label in state.name


@pytest.fixture(scope="module", params=["contact", "spatial contact"])
def folder(request, results, tmp_path_factory):
    """Provide a copy of a result with its fields in both formats."""
    copy = shutil.copytree(results(request.param), tmp_path_factory.mktemp("fields") / "copy")
    for kind in ("vtu", "vtkhdf"):
        assert main(["fields", str(copy), "--format", kind]) == 0
    return copy


def means_of(folder, number):
    """Return load factor, temperature and means of a state as (1, c), from its attributes in result.h5."""
    with h5py.File(folder / "result.h5", "r") as file:
        of_state = dict(file[f"state/{number}"].attrs)
    means = {f"mean_{name}": of_state[name] for name in ("strain", "stress")}
    if "temperature" in of_state:  # tensors, of strains with half of the shears
        means = {name: values[VOIGT[6]].ravel() for name, values in means.items()}
        means["mean_strain"] *= np.where(np.eye(3) > 0, 1.0, 0.5).ravel()
    numbers = {name: of_state[name] for name in ("load_factor", "temperature") if name in of_state}
    return {name: np.atleast_2d(values) for name, values in (numbers | means).items()}


def test_meshio_reads_every_state(folder):
    with h5py.File(folder / "result.h5", "r") as file:
        count, nodes, faces = len(file["state"]), len(file["mesh/points"]), len(file["interface/points"])
    for name, size in (("cell", nodes), ("interface", faces)):
        assert len(list(folder.glob(f"{name}_*.vtu"))) == count
        mesh = meshio.read(folder / f"{name}_{count - 1:04d}.vtu")
        assert mesh.points.shape == (size, 3)
        listed = [entry.attrib for entry in ElementTree.parse(folder / f"{name}.pvd").iter("DataSet")]
        assert listed == [{"timestep": str(k), "file": f"{name}_{k:04d}.vtu"} for k in range(count)]
        expected = means_of(folder, count - 1)
        assert set(mesh.field_data) == set(expected)
        assert all((mesh.field_data[key] == values).all() for key, values in expected.items())
    seen, mesh = read_state(folder, count - 1), meshio.read(folder / f"cell_{count - 1:04d}.vtu")
    (block,) = mesh.cells
    assert block.type == ("triangle" if seen.cells.shape[1] == 3 else "triangle6")
    np.testing.assert_array_equal(block.data, seen.cells)
    for own, read in ((seen.nodes, mesh.point_data), (seen.elements, {k: v[0] for k, v in mesh.cell_data.items()})):
        assert set(own) == set(read)
        for name, array in own.items():
            np.testing.assert_array_equal(read[name], array)


def test_a_full_disk_is_one_error_before_hdf5_writes(folder, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = sorted(path.name for path in folder.iterdir())
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(FetiHomogError, match=r"cannot write .*cell\.vtkhdf: No space left on device"):
        viewed_states.write_vtk(folder, "vtkhdf")
    assert sorted(path.name for path in folder.iterdir()) == before


def test_vtk_reads_the_states_as_steps(folder):
    with h5py.File(folder / "result.h5", "r") as file:
        count = len(file["state"])
    reader = vtkHDFReader()
    reader.SetFileName(str(folder / "cell.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == count
    for step in (0, count - 1):
        reader.SetStep(step)
        reader.Update()
        data, expected = reader.GetOutputDataObject(0), means_of(folder, step) | {"Time": np.array([[float(step)]])}
        arrays = data.GetFieldData()
        assert {arrays.GetArrayName(i) for i in range(arrays.GetNumberOfArrays())} == set(expected)
        assert all((vtk_to_numpy(arrays.GetArray(name)) == values).all() for name, values in expected.items())
    seen = read_state(folder, count - 1)
    cells = vtk_to_numpy(data.GetCells().GetConnectivityArray())
    np.testing.assert_array_equal(cells.reshape(seen.cells.shape), seen.cells)
    for own, arrays in ((seen.nodes, data.GetPointData()), (seen.elements, data.GetCellData())):
        assert {arrays.GetArrayName(i) for i in range(arrays.GetNumberOfArrays())} == set(own)
        for name, array in own.items():
            np.testing.assert_array_equal(vtk_to_numpy(arrays.GetArray(name)), array)


def test_a_missing_state_is_named(results):
    with pytest.raises(CaseError, match="has no state 99: its"):
        read_state(results("contact"), 99)


def test_a_result_that_the_program_has_open_is_one_line(results):
    path = results("contact") / "result.h5"
    with (
        h5py.File(path),
        pytest.raises(CaseError, match=r"^cannot read .*result.h5: it is open in this program: close"),
    ):
        read_state(path.parent)
    with h5py.File(path, locking=False):
        assert len(read_state(path.parent).points)


def test_a_result_without_fields_is_one_line(tmp_path):
    with pytest.raises(
        CaseError, match=r"^cannot read .*result.h5: it is missing; run the case again with \[output\] fields = true$"
    ):
        read_state(tmp_path)
