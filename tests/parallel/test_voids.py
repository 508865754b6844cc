"""Cells with voids against closed forms, a monolithic solve, debonded fibres and the certificate of their files."""

import json

import numpy as np
import pytest
from support.cases import MATRIX, case_of, monolithic_stiffness, relative_error, solve
from support.void_cells import write_voids

from feti_homog import run
from feti_homog.verify.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
RANDOM = {"geometry": "random", "fibres": 4, "fibre_fraction": 0.35, "min_gap": 0.2, "seed": 2}


BARE = {"material": {"matrix": MATRIX}}


def porous(folder, cell=(), **sections):
    return case_of({"geometry": "mesh", "file": "cell.msh", "voids": True} | dict(cell), folder, **sections)


def write(comm, path, **cell):
    if comm.rank == 0:
        write_voids(path / "cell.msh", **cell)
    comm.barrier()


@pytest.mark.parametrize(("cell", "decomposition"), [({"refine": 1}, {}), ({"order": 2}, {"subdomains": 5})])
def test_torn_cell_with_voids_and_fibres_has_the_monolithic_stiffness(comm, shared_path, cell, decomposition):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    torn, L, responses = solve(porous(shared_path, cell, decomposition=decomposition), comm)
    assert torn.summary.voids >= 1 and torn.summary.fibres + torn.summary.voids == 4
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-9
    assert max(max(r.checks.values()) for r in responses) < 1e-8


def test_strain_of_voids_is_missed_if_it_is_not_counted(comm, shared_path):
    """Without the boundary integrals the mean strain is wrong by about the porosity."""
    write(comm, shared_path)
    torn, _, _ = solve(porous(shared_path, **BARE, decomposition={"subdomains": 5}), comm)
    m, sums = torn.solver.problem.strains, np.zeros(1)
    for s in torn.subdomains:
        bodies_alone = np.linalg.solve(s.L[:m, :m], s.Q[:, :m].T).T
        sums += np.abs(bodies_alone - s.mean_strain(np.arange(s.n_dofs))).sum()
    assert comm.allreduce(sums)[0] > 0.1


@pytest.mark.one_rank
def test_square_cell_of_round_voids(comm, shared_path):
    """The spectral solution: Kolosov-Muskhelishvili series, two truncations of which agree to the digits given."""
    write(comm, shared_path, mesh_size=0.1)
    _, L, _ = solve(porous(shared_path, {"order": 2, "refine": 2}, **BARE), comm)
    assert [L[0, 0], L[0, 1], L[2, 2]] == pytest.approx((40.268438, 9.710096, 6.303568), rel=2e-4)


def test_springs_that_have_no_interface_change_no_cell_of_voids(comm, shared_path):
    write(comm, shared_path, geometry="square", fibre_fraction=0.2, mesh_size=0.1, voids=[0])
    springs = {"normal_stiffness": 2.0, "tangential_stiffness": 1.0}
    results = [run(porous(shared_path, **BARE, **more), comm, quiet=True) for more in ({}, {"interface": springs})]
    L, errors = ([getattr(r, name) for r in results] for name in ("effective_stiffness", "mesh_error"))
    assert relative_error(*L) < 1e-9 and errors[0] is not None
    np.testing.assert_allclose(*(error.effective_stiffness for error in errors), rtol=1e-6)


def test_a_debonded_fibre_without_contact_is_a_void(comm, shared_path):
    write(comm, shared_path)
    empty = run(porous(shared_path, {"order": 2}, **BARE), comm)
    write(comm, shared_path, voids=[])
    free = {"contact": False, "debonded": [{"fibre": "all", "centre": 0.0, "angle": 360.0}]}
    parted = run(porous(shared_path, {"order": 2}, interface=free), comm)
    assert relative_error(parted.effective_stiffness, empty.effective_stiffness) < 1e-9


@pytest.mark.parametrize("plane", ["stress", "generalized"])
def test_files_are_certified_and_what_is_reported_of_voids_is_checked(comm, shared_path, plane):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    out = shared_path / plane
    result = run(porous(shared_path, {"order": 2}, analysis={"type": "stiffness", "plane": plane}), comm, out=out)
    assert result.status == "done" and 0.05 < result.cell.porosity < 0.3
    assert sum(result.cell.fractions.values()) == pytest.approx(1 - result.cell.porosity)
    assert plane == "generalized" or (result.bounds is None and result.moduli is not None)
    if comm.rank == 0:
        assert not broken(out)
        for porosity in (0.0, result.cell.porosity * 1.001):
            document = json.loads((out / "result.json").read_text())
            document["cell"]["porosity"] = porosity
            (out / "result.json").write_text(json.dumps(document))
            assert {"mesh", "cell"} <= broken(out)
    comm.barrier()


@pytest.mark.one_rank
def test_an_envelope_beside_voids_is_certified(comm, shared_path):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    sections = {
        "interface": {"normal_strength": 5.0, "tangential_strength": 5.0},
        "envelope": {"plane": ["S22", "S12"], "directions": 6},
    }
    result = run(porous(shared_path, **sections), comm, out=shared_path / "out")
    assert result.status == "done"
    assert comm.bcast(broken(shared_path / "out") if comm.rank == 0 else None) == set()


def broken(folder):
    return {finding.name for finding in verify(folder).findings if not finding.holds}
