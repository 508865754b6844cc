"""Cells with voids against closed forms, a monolithic solve, debonded fibres and the certificate of their files."""

import json

import numpy as np
import pytest
from reference.closed_forms import bulk_and_shear
from support.cases import FIBRE, MATRIX, monolithic_stiffness, relative_error, solve
from support.void_cells import write_voids

from feti_homog import run
from feti_homog.case import cases
from feti_homog.verify.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
STRENGTHS = {"normal_strength": 5.0, "tangential_strength": 5.0}
RANDOM = {"geometry": "random", "fibres": 4, "fibre_fraction": 0.35, "min_gap": 0.2, "seed": 2}


def case_of(folder, fibre=True, plane="strain", interface=None, decomposition=None, **cell):
    document = {
        "cell": {"geometry": "mesh", "file": "cell.msh", "voids": True} | cell,
        "material": {"matrix": MATRIX} | ({"fibre": FIBRE} if fibre else {}),
        "analysis": {"type": "stiffness", "plane": plane},
        "decomposition": decomposition or {},
        "petsc": {"feti_ksp_rtol": 1e-11},
        "output": {"pictures": False},
    }
    return cases.parse(document | ({"interface": interface} if interface else {}), folder)


def write(comm, path, **cell):
    if comm.rank == 0:
        write_voids(path / "cell.msh", **cell)
    comm.barrier()


@pytest.mark.parametrize(("cell", "decomposition"), [({"refine": 1}, {}), ({"order": 2}, {"subdomains": 5})])
def test_torn_cell_with_voids_and_fibres_has_the_monolithic_stiffness(comm, shared_path, cell, decomposition):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    torn, L, responses = solve(case_of(shared_path, decomposition=decomposition, **cell), comm)
    assert torn.summary.voids >= 1 and torn.summary.fibres + torn.summary.voids == 4
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-9
    assert max(max(r.checks.values()) for r in responses) < 1e-8


def test_strain_of_voids_is_missed_if_it_is_not_counted(comm, shared_path):
    """Without the boundary integrals the mean strain is wrong by about the porosity."""
    write(comm, shared_path)
    torn, _, _ = solve(case_of(shared_path, fibre=False, decomposition={"subdomains": 5}), comm)
    m, sums = torn.solver.problem.strains, np.zeros(1)
    for s in torn.subdomains:
        bodies_alone = np.linalg.solve(s.L[:m, :m], s.Q[:, :m].T).T
        sums += np.abs(bodies_alone - s.mean_strain(np.arange(s.n_dofs))).sum()
    assert comm.allreduce(sums)[0] > 0.1


@pytest.mark.one_rank
def test_square_cell_of_round_voids(comm, shared_path):
    """The spectral solution: Kolosov-Muskhelishvili series, two truncations of which agree to the digits given."""
    write(comm, shared_path, mesh_size=0.1)
    _, L, _ = solve(case_of(shared_path, fibre=False, order=2, refine=2), comm)
    assert [L[0, 0], L[0, 1], L[2, 2]] == pytest.approx((40.268438, 9.710096, 6.303568), rel=2e-4)


def test_few_voids_soften_as_the_dilute_limit_says(comm, shared_path):
    """dk/dc = -k (k + mu) / mu, d mu/dc = -2 mu (k + mu) / k at c = 0, to first order in c."""
    c, (k, mu) = 0.004, bulk_and_shear(MATRIX)
    write(comm, shared_path, fibre_fraction=c, mesh_size=0.2, interface_size=0.01)
    _, L, _ = solve(case_of(shared_path, fibre=False, order=2, refine=1), comm)
    bulk, shear = (L[0, 0] + L[0, 1]) / 2, L[2, 2]
    assert (bulk - k) / c == pytest.approx(-k * (k + mu) / mu, rel=0.03)
    assert (shear - mu) / c == pytest.approx(-2 * mu * (k + mu) / k, rel=0.03)


def test_a_debonded_fibre_without_contact_is_a_void(comm, shared_path):
    write(comm, shared_path)
    empty = run(case_of(shared_path, fibre=False, order=2), comm)
    write(comm, shared_path, voids=[])
    free = {"contact": False, "debonded": [{"fibre": "all", "centre": 0.0, "angle": 360.0}]}
    parted = run(case_of(shared_path, interface=free, order=2), comm)
    assert relative_error(parted.effective_stiffness, empty.effective_stiffness) < 1e-9


@pytest.mark.parametrize("plane", ["stress", "generalized"])
def test_files_are_certified_and_what_is_reported_of_voids_is_checked(comm, shared_path, plane):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    out = shared_path / plane
    result = run(case_of(shared_path, plane=plane, order=2), comm, out=out)
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
@pytest.mark.parametrize(
    "sections",
    [
        {
            "analysis": {"type": "path", "plane": "strain"},
            "interface": STRENGTHS | {"normal_stiffness": 900.0, "tangential_stiffness": 300.0},
            "path": {"to": {"E11": 0.2}},
        },
        {
            "analysis": {"type": "envelope", "plane": "strain"},
            "interface": STRENGTHS,
            "envelope": {"plane": ["S22", "S12"], "directions": 6},
        },
    ],
    ids=["path", "envelope"],
)
def test_debonding_beside_voids_is_certified(comm, shared_path, sections):
    write(comm, shared_path, voids=[0, 1], **RANDOM)
    document = {
        "cell": {"geometry": "mesh", "file": "cell.msh", "voids": True},
        "material": {"matrix": MATRIX, "fibre": FIBRE},
        "output": {"pictures": False},
    }
    result = run(cases.parse(document | sections, shared_path), comm, out=shared_path / "out")
    assert result.status == "done" and (result.path is None or len(result.path) > 4)
    assert comm.bcast(broken(shared_path / "out") if comm.rank == 0 else None) == set()


def broken(folder):
    return {finding.name for finding in verify(folder).findings if not finding.holds}
