"""`feti-homog statistics`: the fibres of tables, results and cases, and what is written and printed of them."""

import csv
from pathlib import Path

import fibre_statistics
import numpy as np
import pytest
from fibre_statistics import text
from mpi4py import MPI
from pattern_statistics import hard_core, measure, poisson, smallest_gap
from support.base_case import BASE, RANDOM
from support.fibre_patterns import hexagonal_lattice, poisson_points, square_lattice
from unit.mesh.faulty_meshes import grid

from feti_homog.analysis.runner import run
from feti_homog.case import cases
from feti_homog.errors import CaseError, MeshError
from feti_homog.microstructure.random_fibres import nearest_neighbours
from feti_homog.system.runtime.standard_streams import Progress

MESHES = Path(__file__).parents[3] / "meshes"
SMALL = BASE.replace('geometry = "hexagonal"\n', f"{RANDOM}width = 40.0\n").replace("0.05", "0.1")


def write(path, text):
    path.write_text(text)
    return path


def columns(path):
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_a_case_and_its_result_have_the_same_fibres(tmp_path):
    path = write(tmp_path / "case.toml", SMALL + "[output]\npictures = false\nfields = false\n")
    run(cases.load(path), tmp_path / "result", Progress(MPI.COMM_SELF, quiet=True))
    of_case, of_result = fibre_statistics.pattern(path, None), fibre_statistics.pattern(tmp_path / "result", None)
    assert (of_case.width, of_result.width, of_case.periodic, of_result.periodic) == (40.0, 40.0, True, True)
    away = (of_result.centres - of_case.centres + 20) % 40 - 20
    assert of_result.radii == pytest.approx(of_case.radii) and away == pytest.approx(0, abs=1e-9)
    assert of_case.fibre_fraction == pytest.approx(0.4)


def test_fibres_of_a_mesh_are_found(tmp_path):
    cell = f'geometry = "mesh"\nfile = "{MESHES / "hexagonal.msh"}"\n'
    text = BASE.replace('geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05\n', cell)
    found = fibre_statistics.pattern(write(tmp_path / "case.toml", text), None)
    assert found.count == 2 and found.fibre_fraction == pytest.approx(0.4, abs=1e-6)
    assert nearest_neighbours(found).means == pytest.approx(found.width * np.ones(3))


@pytest.mark.parametrize("size", [None, (12.0, 8.0)])
def test_tables_are_windows(tmp_path, size):
    comment = "" if size else "# width = 12, height = 8, left = 100, bottom = -4\n"
    corner = (0.0, 0.0) if size else (100.0, -4.0)
    rows = [f"{x + corner[0]},{y + corner[1]},{r}" for x, y, r in [(1, 2, 1), (5.5, 7.75, 0.5), (12, 0, 0.25)]]
    found = fibre_statistics.pattern(write(tmp_path / "f.csv", "\n".join([f"{comment}x,y,radius", *rows])), size)
    assert (found.width, found.height, found.periodic) == (12.0, 8.0, False)
    assert found.centres == pytest.approx(np.array([[1, 2], [5.5, 7.75], [12, 0]]))
    assert found.fibre_fraction == pytest.approx(np.pi * (1 + 0.25 + 0.0625) / 96)


SIZE = "# width = 12, height = 8\n"


def test_ellipses_count_as_discs_of_the_same_area(tmp_path):
    ellipses = f"{SIZE}x,y,radius,a,b,angle\n1,2,,1,4,30\n5,6,0.5,,,\n"
    discs = f"{SIZE}x,y,radius\n1,2,2\n5,6,0.5\n"
    found, expected = (fibre_statistics.pattern(write(tmp_path / "f.csv", text), None) for text in (ellipses, discs))
    assert np.array_equal(found.radii, expected.radii) and np.array_equal(found.centres, expected.centres)


FAULTY = {
    "x,y,radius\n1,2,1\n3,4,1\n": ["f.csv: the size of the window is missing"],
    f"{SIZE}x,y,radius\n1,2,1\n13,4,1\n1,-0.5,1\n": ["row 4: its centre is outside", "row 5: its centre is outside"],
    f"{SIZE}x,y,radius\n1,2,1\n3,4,1\n1,2,2\n": ["row 5: there is a fibre at the same place before"],
    f"{SIZE}x,y,radius\n1,2,1\n": ["expected at least two fibres, got 1"],
    f"{SIZE}x,y,radius,a,b\n1,2,1,1,2\n3,4,1,,\n": ["row 3: has a radius and semi-axes"],
    f"{SIZE}x,y,radius\n1,2,1\n3,four,1\n": ['row 4: y = "four"'],
}


@pytest.mark.parametrize("text", FAULTY)
def test_faults_of_tables(tmp_path, text):
    with pytest.raises(CaseError) as error:
        fibre_statistics.pattern(write(tmp_path / "f.csv", text), None)
    assert len(error.value.faults) == len(FAULTY[text])
    assert all(words in fault for words, fault in zip(FAULTY[text], error.value.faults, strict=True))


def test_other_faults(tmp_path):
    case = write(tmp_path / "case.toml", BASE.replace("hexagonal", "square"))
    grid().write(tmp_path / "cell.msh")
    materials = BASE[BASE.index("[material") :]
    other = write(tmp_path / "other.toml", f'[cell]\ngeometry = "mesh"\nfile = "cell.msh"\n{materials}')
    for path, size, words in [
        (case, None, "expected at least two fibres, got 1"),
        (other, None, "fibres that are neither round nor ellipses have no radius: 1$"),
        (case, (1.0, 1.0), "--size: only for a table"),
        (tmp_path, None, "cannot read"),
        (tmp_path / "nowhere.csv", None, f"{tmp_path}/nowhere.csv: cannot be read"),
    ]:
        with pytest.raises(CaseError, match=words):
            fibre_statistics.pattern(path, size)


def test_tables_and_picture_hold_what_was_measured(tmp_path):
    path = write(tmp_path / "case.toml", SMALL)
    lines = fibre_statistics.run(path, tmp_path / "out", "poisson", 5)
    names = ["fibre_statistics.csv", "pair_functions.csv", "pair_directions.csv", "statistics.png"]
    assert lines[1:] == [str(tmp_path / "out" / name) for name in names]
    assert sorted(names) == sorted(p.name for p in (tmp_path / "out").iterdir())
    fibres, pairs, directions = (columns(tmp_path / "out" / name) for name in names[:3])
    assert fibres["voronoi_area"].sum() == pytest.approx(1600.0)
    assert fibres["voronoi_area"] @ fibres["local_fraction"] / 1600 == pytest.approx(0.4)
    distances = nearest_neighbours(fibre_statistics.pattern(path, None)).distances
    assert fibres["distance_2"] == pytest.approx(distances[:, 1])
    assert pairs["L"] == pytest.approx(np.sqrt(pairs["K"] / np.pi))
    rings = np.pi * np.diff(pairs["r"] ** 2, prepend=0)
    assert np.cumsum(rings * pairs["g"]) == pytest.approx(pairs["K"])
    assert np.all(pairs["L_random_low"] <= pairs["L_random_mean"])
    assert directions["relative_share"].mean() == pytest.approx(1.0) and directions["angle"][-1] == 165.0
    assert "fibre fraction  0.4000" in lines[0] and "periodic cell of 40 x 40" in lines[0]


@pytest.mark.parametrize(
    ("fibres", "simulations", "words"),
    [
        (square_lattice(), 39, "p = 0.025, not one of its patterns at 5 %"),
        (square_lattice(), 18, "p = 0.0526, too few simulations for a level of 5 %"),
        (poisson_points(40), 19, "indistinguishable from it"),
    ],
)
def test_randomness_is_judged_by_enough_simulations(fibres, simulations, words):
    found = measure(fibres, poisson, simulations)
    assert text(found, "poisson", simulations).endswith(words)


def test_without_out_nothing_is_written(tmp_path):
    path = write(tmp_path / "case.toml", SMALL)
    assert len(fibre_statistics.run(path, None, "hard-core", 2)) == 1 and list(tmp_path.iterdir()) == [path]


def test_windows_too_small_say_so(tmp_path):
    text = f"{SIZE}x,y,radius\n1,2,1\n11,4,1\n"
    lines = fibre_statistics.run(write(tmp_path / "f.csv", text), tmp_path / "out", "poisson", 2)
    assert "third centre    undetermined: the window is too small" in lines[0]
    assert np.isnan(columns(tmp_path / "out" / "fibre_statistics.csv")["distance_3"]).all()


def test_hard_core_keeps_radii_and_gap_and_is_found_anywhere():
    window = square_lattice(6, periodic=False)
    found = hard_core(window, np.random.default_rng(3))
    assert np.array_equal(found.radii, window.radii) and not found.periodic
    assert smallest_gap(found) >= smallest_gap(window) * (1 - 1e-9) == pytest.approx(0.4)
    assert np.all((found.centres >= 0) & (found.centres <= window.size))
    with pytest.raises(MeshError, match=r"gap 0\.9.*--model poisson"):
        hard_core(hexagonal_lattice(4, radius=0.05), np.random.default_rng(3), max_steps=200)


def test_hard_core_of_overlapping_fibres_has_no_gap():
    overlapping = poisson_points(60, radius=0.5)
    assert smallest_gap(overlapping) < 0 <= smallest_gap(hard_core(overlapping, np.random.default_rng(0))) + 1e-9
