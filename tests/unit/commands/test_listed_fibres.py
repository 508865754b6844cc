"""`feti-homog fibres`: the table of a cell is the cell."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.base_case import BASE
from unit.mesh.faulty_meshes import grid

from feti_homog.analysis.runner import run
from feti_homog.case.cases import load
from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError
from feti_homog.mesh.arrange import arrange
from feti_homog.microstructure.fibre_table import read_table
from feti_homog.system.runtime.standard_streams import Progress

CELL = 'geometry = "hexagonal"\nfibre_fraction = 0.4\n'
FIBRES = 'fibre_list = [{x = 1, y = 2, radius = 0.3}, {x = 2.8, y = 2, radius = 0.3, phase = "fibre:2"}]'
CELLS = {
    "square": 'geometry = "square"\nfibre_fraction = 0.75\n',
    "hexagonal": CELL,
    "random": 'geometry = "random"\nfibres = 30\nfibre_fraction = 0.5\nradius_spread = 0.3\n',
    "with a radius": 'geometry = "random"\nfibres = 9\nfibre_fraction = 0.5\nfibre_radius = 3.5\n',
    "table": f'geometry = "table"\nwidth = 5\nheight = 4\n{FIBRES}\n',
    "cut window": f'geometry = "table"\nwidth = 2.2\nheight = 4\nwindow = "cut"\n{FIBRES}\n',
}
SECOND = '[material."fibre:2"]\nyoung = 300.0\npoisson = 0.2\n'


def case_of(path, cell, more=""):
    path.write_text(BASE.replace(CELL, cell) + more)
    return path


@pytest.mark.parametrize("name", CELLS)
def test_the_table_of_a_cell_gives_the_cell(name, tmp_path):
    source = case_of(tmp_path / "case.toml", CELLS[name], SECOND if "fibre:2" in CELLS[name] else "")
    (tmp_path / "t.csv").write_text(listed_fibres.table(source))
    again = case_of(tmp_path / "again.toml", 'geometry = "table"\nfile = "t.csv"\n', SECOND)
    found, expected = arrange(load(again).cell), arrange(load(source).cell)
    assert found.phase == expected.phase and found.height == pytest.approx(expected.height, rel=1e-15)
    assert np.abs(found.centres - expected.centres).max() < 1e-15
    assert found.radii == pytest.approx(expected.radii, rel=1e-15)


def test_coatings_are_a_column(tmp_path):
    coating = "[material.coating]\nyoung = 3.0\npoisson = 0.2\n"
    source = case_of(tmp_path / "case.toml", f"{CELLS['random']}coating = 0.07\n", coating)
    (tmp_path / "t.csv").write_text(listed_fibres.table(source))
    again = case_of(tmp_path / "again.toml", 'geometry = "table"\nfile = "t.csv"\n', coating)
    found, expected = arrange(load(again).cell), arrange(load(source).cell)
    assert found.coating == pytest.approx(expected.coating, rel=1e-13)


OVALS = """geometry = "table"
width = 5
height = 4
mesh_size = 0.1
fibre_list = [{x = 1, y = 2, a = 0.3, b = 0.8, angle = 20, coating = 0.1}, {x = 2.8, y = 2, radius = 0.3},
    {x = 4.9, y = 0.1, a = 0.8, b = 0.3, angle = -70}]
"""


def squares(cell):
    found = arrange(cell)
    away = found.centres - found.centres[0] + 0.3 * found.size  # another window may be as good
    return found.outlines.squares, found.coating, away % found.size


@pytest.mark.parametrize("of", ["case", "result"])
def test_the_table_of_ellipses_gives_the_cell(of, tmp_path):
    """In a result they are those that its mesh has."""
    coating = "[material.coating]\nyoung = 3.0\npoisson = 0.2\n[output]\npictures = false\nfields = false\n"
    source = case_of(tmp_path / "case.toml", OVALS, coating)
    source.write_text(source.read_text().replace("mesh_size = 0.05\n", ""))
    if of == "result":
        run(load(source), tmp_path / "result", Progress(MPI.COMM_SELF, quiet=True))
    (tmp_path / "t.csv").write_text(listed_fibres.table(tmp_path / "result" if of == "result" else source))
    assert (tmp_path / "t.csv").read_text().splitlines()[1] == "x,y,radius,phase,a,b,angle,coating,number"
    again = case_of(tmp_path / "again.toml", 'geometry = "table"\nfile = "t.csv"\n', coating)
    for found, expected in zip(squares(load(again).cell), squares(load(source).cell), strict=True):
        assert found == pytest.approx(expected, abs=1e-9)


def test_ellipses_of_a_users_mesh_are_found(tmp_path):
    """Find an ellipse of 0.4 x 0.3 beside a disc, as in meshes/README.md."""
    rows = listed_fibres.table(Path(__file__).parents[3] / "drivers" / "two_fibres.toml")
    (tmp_path / "t.csv").write_text(rows)
    table = read_table(tmp_path / "t.csv")
    a, b, angle = (table.columns[name][0] for name in ("a", "b", "angle"))
    assert [a, b, angle % 180] == pytest.approx([0.4, 0.3, 180.0], abs=1e-6)
    assert table.centres == pytest.approx(np.array([[0.6, 0.5], [1.5, 0.5]]), abs=1e-6)
    assert table.radius[1] == pytest.approx(0.3)
    assert np.isnan([table.columns["radius"][0], table.columns["a"][1]]).all()


def test_fibres_of_other_shapes_have_a_number_and_a_centre(tmp_path):
    """A case refuses this table: without a radius it cannot give the cell."""
    grid().write(tmp_path / "cell.msh")
    source = case_of(tmp_path / "case.toml", 'geometry = "mesh"\nfile = "cell.msh"\n')
    source.write_text(source.read_text().replace("mesh_size = 0.05\n", ""))
    (tmp_path / "t.csv").write_text(listed_fibres.table(source))
    assert (tmp_path / "t.csv").read_text().splitlines()[1:] == ["x,y,radius,phase,number", "0.5,0.5,,fibre,1"]
    with pytest.raises(CaseError, match="row 3: radius"):
        read_table(tmp_path / "t.csv")


def test_units_and_names(tmp_path):
    source = case_of(tmp_path / "case.toml", CELLS["with a radius"])
    (tmp_path / "t.csv").write_text(listed_fibres.table(source))
    table = read_table(tmp_path / "t.csv")
    assert table.radius.mean() == pytest.approx(3.5, rel=1e-14) and table.phase == ("fibre",) * 9
    assert np.pi * np.sum(table.radius**2) / (table.width * table.height) == pytest.approx(0.5, rel=1e-14)
    assert (table.left, table.bottom) == (0.0, 0.0)
    moved = replace(load(source).cell, fibre_radius=None)
    assert np.abs(table.centres / table.width - arrange(moved).centres).max() < 1e-15


def test_numbers_of_fibres_are_those_of_arcs_and_voids_have_none(tmp_path):
    voids = 'geometry = "random"\nfibres = 2\nfibre_fraction = 0.3\nvoids = 0.05\n'
    header, *rows = listed_fibres.table(case_of(tmp_path / "case.toml", voids)).splitlines()[1:]
    assert header.split(",")[3] == "phase" and header.split(",")[-1] == "number"
    assert [row.split(",")[3:] for row in rows] == [["fibre", "1"], ["fibre", "2"], ["void", ""]]
