"""A cell of matrix alone, one body without a bond: it is run like others, and its results obey every law."""

from dataclasses import replace

import pytest
from support.layered_meshes import layers
from support.loaded_twins import EPOXY_GLASS, document
from support.ranks import assert_certified, write_once
from unit.mesh.faulty_meshes import MATRIX

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

INFLUENCE = {"feti_pc_type": "influence"}
ENERGY = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "criterion": "energy", "toughness": 1.0}


@pytest.mark.parametrize(("petsc", "by_energy"), [(None, False), (INFLUENCE, True)], ids=["stiffness", "path"])
def test_a_cell_of_matrix_alone_obeys_every_law(comm, shared_path, petsc, by_energy):
    write_once(comm, replace(layers("MMM", 0), names={MATRIX: "matrix"}), shared_path / "matrix.msh")
    analysis = {"path": {"to": {"E11": 0.1}}, "interface": ENERGY} if by_energy else {"stiffness": None}
    case = document({"geometry": "mesh", "file": "matrix.msh"}, EPOXY_GLASS[:1], "strain", petsc=petsc, **analysis)
    case["output"]["fields"], case["decomposition"] = True, {"subdomains": 1}
    result = run(Case.parse(case, shared_path), comm, out=shared_path / "out")
    assert result.status == "done" and result.solver.multipliers == 0
    assert_certified(comm, shared_path / "out")
