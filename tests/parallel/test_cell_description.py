"""`check` describes the solver that a run makes."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.base_case import changed
from support.label_images import RUN, circles_in_pixels

from feti_homog import Case, CaseError, run
from feti_homog.analysis.cell_records import SolverInfo
from feti_homog.analysis.description import describe
from feti_homog.homogenization.partition_policy import BY_COST
from feti_homog.homogenization.unit_cell import tear
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

MESHES = Path(__file__).parents[2] / "meshes"

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

COATED = (("mesh_size = 0.05", "mesh_size = 0.2\ncoating = 0.1"),)
COATING = "[material.coating]\nyoung = 20.0\npoisson = 0.3\n"
PATH = (("mesh_size = 0.05", "mesh_size = 0.2"), ('type = "stiffness"', 'type = "path"'))
STRENGTH = "[path]\nstrain = [0.01, 0, 0]\n[interface]\nnormal_strength = 1.0\ntangential_strength = 1.0\n"
SQUARE = """geometry = "table"
width = 1.0
height = 1.0
fibre_list = [{x = 0.5, y = 0.5, radius = 0.35, sides = 4, angle = 45.0}]"""
MIX = """geometry = "random"
mix = {fibre = 0.2, glass = 0.2}
radii = {fibre = 1.0, glass = 2.0}
width = 10.0"""
BODIES = '[decomposition]\ncut = "bodies"\n'
CASES = {
    "bonded": changed(("mesh_size = 0.05", "mesh_size = 0.2")),
    "cut": changed(("mesh_size = 0.05", "mesh_size = 0.05\nrefine = 1")),
    "coated": changed(*COATED, end=COATING),
    "path": changed(*PATH, end=STRENGTH),
    "coated, implicit": changed(*COATED, end=f'{COATING}[petsc]\nfeti_dual_operator = "implicit"\n'),
    "polygon": changed(('geometry = "hexagonal"\nfibre_fraction = 0.4', SQUARE), ("= 0.05", "= 0.2")),
    "mix": changed(
        ('geometry = "hexagonal"\nfibre_fraction = 0.4', MIX),
        ("= 0.05", "= 0.2"),
        end="[material.glass]\nyoung = 70.0\npoisson = 0.2\n",
    ),
    "bonded, influence": changed(end='[petsc]\nfeti_pc_type = "influence"\n'),
    "in space": changed(('plane = "strain"', 'plane = "generalized"'), ("= 0.05", "= 0.1\norder = 2"), end=BODIES),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", CASES)
def test_the_solver_is_the_one_that_is_reported(comm, name):
    case = Case.parse(tomllib.loads(CASES[name]))
    with case_options(case.petsc):
        printed = comm.bcast(describe(case, comm))
        cell = tear(case, comm, Progress(comm, quiet=True), policy=BY_COST)
    (line,) = [line for line in printed.splitlines() if line.startswith("solver")]
    assert ("influence columns" in line) == (cell.solver.exact_inverse is not None)
    assert ("adaptive coarse space" in line) == (cell.solver.adaptive is not None)
    assert bool(re.search(r"^mix .* of glass, mean radius [\d.]+$", printed, re.MULTILINE)) == (name == "mix")
    assert_same_sizes(comm, printed, cell)


def assert_same_sizes(comm, printed, cell):
    """Compare the numbers of `check` with the numbers in result.json.  Collective."""
    sizes = SolverInfo.of(cell, (), ())
    total, *of_ranks = map(int, re.findall(r"(\d+) degrees of freedom$", printed, re.MULTILINE))
    assert (total, len(of_ranks), sum(of_ranks)) == (sizes.dofs, comm.size, sizes.dofs)
    assert f", {sizes.multipliers} multipliers\n" in printed
    cell.destroy()


@pytest.mark.parametrize("order", [1, 2])
def test_pixels_have_the_degrees_of_freedom_of_a_run(comm, shared_path, order):
    path = shared_path / "image.npy"
    if comm.rank == 0:
        np.save(path, circles_in_pixels(20))
    comm.barrier()
    cell = {"geometry": "pixels", "file": str(path), "labels": {"0": "matrix", "1": "fibre"}, "order": order}
    case = Case.parse(RUN | {"cell": cell})
    with case_options(case.petsc):
        printed = comm.bcast(describe(case, comm))
        assert_same_sizes(comm, printed, tear(case, comm, Progress(comm, quiet=True), policy=BY_COST))


def test_only_paths_have_the_memory_of_complete_debonding(comm):
    printed = [comm.bcast(describe(Case.parse(tomllib.loads(CASES[name])), comm)) for name in ("path", "bonded")]
    lines = [line for text in printed for line in text.splitlines() if line.startswith("estimate")]
    assert ["if all bonds break" in line for line in lines] == [True, False]


@pytest.mark.parametrize("option", ['feti_pc_type = "lumped"', 'feti_dual_operator = "implicit"'])
def test_friction_without_influence_columns_is_refused_by_both(comm, option):
    case = Case.parse(tomllib.loads(changed(*PATH, end=f"{STRENGTH}friction = 0.3\n[petsc]\n{option}\n")))
    with pytest.raises(CaseError) as of_run:
        run(case, comm)
    with pytest.raises(CaseError) as of_check, case_options(case.petsc):
        describe(case, comm)
    assert of_run.value.faults == of_check.value.faults


ARCS = """[interface]
debonded = [{fibre = 2, centre = 90, angle = 60}, {fibre = "all", angle = 30}, {fibre = [1, 2], angle = 0}]
"""
LISTED = """geometry = "table"
width = 1.0
height = 1.0
fibre_list = [{x = 0.2, y = 0.3, radius = 0.1, phase = "void"}, {x = 0.75, y = 0.25, radius = 0.2},
    {x = 0.5, y = 0.75, radius = 0.15}]"""


def test_the_fibres_of_arcs_are_named_by_number_row_and_centre(comm):
    """Numbers count the fibres of the list, without its void."""
    text = changed(('geometry = "hexagonal"\nfibre_fraction = 0.4', LISTED), ("= 0.05", "= 0.2"), end=ARCS)
    printed = comm.bcast(describe(Case.parse(tomllib.loads(text)), comm))
    first, second = "1 (fibre, row 2, centre (0.75, 0.25))", "2 (fibre, row 3, centre (0.5, 0.75))"
    assert [line for line in printed.splitlines() if line.startswith("arc")] == [
        f"arc        [interface] debonded[0]: angle 60 about 90 degrees, fibre {second}",
        "arc        [interface] debonded[1]: angle 30 about 0 degrees, fibre all",
        f"arc        [interface] debonded[2]: angle 0 about 0 degrees, fibre {first}, {second}",
    ]


def test_arcs_in_a_mesh_of_the_user_end_at_its_nodes(comm):
    case = tomllib.loads(changed(end=ARCS)) | {"cell": {"geometry": "mesh", "file": str(MESHES / "square.msh")}}
    case["interface"] = {"debonded": [{"fibre": 1, "centre": 40.0, "angle": 81.0}]}
    words = "angle 81 about 40 degrees, tips at the next nodes outside, fibre 1 ("
    assert words in comm.bcast(describe(Case.parse(case), comm))
