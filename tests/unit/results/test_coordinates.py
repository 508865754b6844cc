"""Fibres and nodes come out where they were given."""

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI
from support.cases import case_of
from support.other_formats import written
from unit.mesh.faulty_meshes import grid

from feti_homog import draw_state, run
from feti_homog.errors import FetiHomogError
from feti_homog.results.viewed_states import read_state

MATERIAL = {"matrix": {"young": 3.0, "poisson": 0.3}, "fibre": {"young": 70.0, "poisson": 0.2}}
# A disc that touches the lower side, so that the cell is shifted; a comment and a row outside the window.
ROWS = "106.0812345678912,217.37,4\n# none\n137.25,203.7,3.7\n90,210,4\n145.8,231.9,4.2\n"
TABLE = f"# width = 50, height = 40, left = 100, bottom = 200\nx,y,radius\n{ROWS}"


def result_of(folder, **cell):
    case = case_of(cell, material=MATERIAL, output={"pictures": False, "fields": True})
    return run(case, MPI.COMM_SELF, out=folder)


def test_fibres_of_a_cropped_table_have_the_centres_and_rows_of_the_table(tmp_path):
    (tmp_path / "t.csv").write_text(TABLE)
    result = result_of(tmp_path / "out", geometry="table", file=str(tmp_path / "t.csv"), window="cut", mesh_size=0.1)
    listed = np.array([line.split(",")[:2] for line in ROWS.splitlines() if "," in line], float)
    assert [fibre.row for fibre in result.fibres] == [3, 5, 7]  # lines of the file
    assert [fibre.centre.tolist() for fibre in result.fibres] == listed[[0, 1, 3]].tolist()
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        points, fibre = file["interface/points"][:], file["interface/fibre_number"][:] - 1
        off = (file["fibre/centre"][:] - listed[[0, 1, 3]]) / [50, 40]
        assert off == pytest.approx(np.round(off), abs=1e-9)  # an image within the meshed cell
        own = points - file["fibre/centre"][:][fibre]
        own -= np.round(own / [50, 40]) * [50, 40]
        assert np.hypot(*own.T) == pytest.approx(np.array([4, 3.7, 4.2])[fibre], rel=1e-13)  # beyond the digits of gmsh
        away = points - listed[[0, 1, 3]][fibre]
        away -= np.round(away / [50, 40]) * [50, 40]
        assert np.hypot(*away.T) == pytest.approx(np.array([4, 3.7, 4.2])[fibre], rel=1e-8)
        corner = file["mesh/points"][:].min(axis=0)
    assert corner == pytest.approx(result.cell.origin, abs=1e-12) and (corner != [100, 200]).any()
    assert (np.abs(corner - [100, 200]) <= [25, 20]).all()
    axes = Figure().subplots()
    draw_state(axes, tmp_path / "out", scale=0.0)
    assert axes.dataLim.min == pytest.approx(corner, abs=1e-9) and axes.dataLim.size == pytest.approx([50, 40])
    with pytest.raises(FetiHomogError, match=r"^cannot draw state 0 of .*: 'S1'"):
        draw_state(axes, tmp_path / "out", stress="S1")


@pytest.mark.parametrize("suffix", ["msh", "inp", "vtu", "vtk", "mesh"])
def test_nodes_of_a_mesh_are_those_of_its_file(tmp_path, suffix):
    mesh = grid().moved(**{f"n{tag}": (x - 5, y + 7) for tag, (x, y, _) in grid().nodes.items()})
    cell = {"geometry": "mesh", "file": str(written(mesh, tmp_path / f"cell.{suffix}"))}
    if suffix == "mesh":  # its references are numbers
        cell["phases"] = {"matrix": 0, "fibre": 1}
    result = result_of(tmp_path / "out", **cell)
    assert tuple(result.cell.origin) == (-5.0, 7.0)
    places = {tuple(np.round(place[:2], 9) + 0.0) for place in mesh.nodes.values()}
    assert {tuple(np.round(place[:2], 9) + 0.0) for place in read_state(tmp_path / "out").points} == places
