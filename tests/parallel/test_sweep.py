"""Sweeps in process: against references and bounds, and the same numbers on any number of ranks."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from reference.references import BONDED
from support.ranks import parallel_assert
from support.sweep_files import BY_BODIES, CASE, RANDOM

from feti_homog import run
from feti_homog.errors import ConvergenceError
from feti_homog.studies import case_folders, case_runs, collect, sweep_cases
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

FRACTIONS = "'cell.fibre_fraction' = {from = 0.1, to = 0.6, step = 0.1}\n"


def swept(comm, folder, table, case=CASE, ranks_per_case=None):
    """Return the collected table of a sweep, on every rank."""
    sweep = sweep_cases.expand({"name": "sweep"} | tomllib.loads(f"{case}[sweep]\n{table}"), Path())
    case_runs.run_all(sweep, folder / "out", comm, ranks_per_case or comm.size, retry=False, quiet=True)
    return on_root(comm, collect.read, folder / "out")


def test_hexagonal_cells_reach_the_reference_within_the_bounds(comm, shared_path):
    case = CASE.replace("mesh_size = 0.3", "mesh_size = 0.15\norder = 2")
    table = swept(comm, shared_path, FRACTIONS, case)
    found = table.outputs
    fractions = np.array(table.inputs["cell.fibre_fraction"])
    for name, value in zip(("C11", "C12", "C33"), BONDED["hexagonal", "strain"].value, strict=True):
        assert found[name][fractions == 0.4] == pytest.approx(value, rel=3e-4)
    for modulus in ("bulk", "shear"):
        below, above = (found[f"{modulus}_{side}"] for side in ("lower", "upper"))
        assert (found[modulus] > below).all() and (found[modulus] < above).all(), modulus
    for name in ("C11", "C33"):
        assert (found[f"{name}_reuss"] < found[name]).all() and (found[name] < found[f"{name}_voigt"]).all()
    isotropic = (found["C11"] - found["C12"]) / 2
    assert np.abs(found["C33"] / isotropic - 1).max() < 2e-4


def test_the_same_seeds_give_the_same_numbers(comm, shared_path):
    """On all ranks together, on each alone, and in the sweep."""
    table = swept(comm, shared_path, "realisations = 3\n", RANDOM)
    names = [f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
    found = np.array([table.outputs[name] for name in names]).T
    for row, seed in enumerate(table.inputs["cell.seed"]):
        case = sweep_cases.expand({"sweep": {"cell.seed": [seed]}} | tomllib.loads(RANDOM), Path()).cases[0]
        alone = run(case, MPI.COMM_SELF).effective_stiffness
        assert found[row] == pytest.approx(alone.ravel(), rel=1e-6, abs=1e-5)
    assert np.abs(found[0] - found[1]).max() > 0.1


def test_groups_of_ranks_compute_every_case_once(comm, shared_path):
    """Compute as many cases at once as there are ranks: each once, by one rank."""
    table = swept(comm, shared_path, FRACTIONS, ranks_per_case=1)
    assert set(table.status) == {"done"} and set(table.outputs["ranks"]) == {1.0}
    times = {p: p.stat().st_mtime_ns for p in shared_path.glob("out/case-*/result.json")}
    comm.barrier()
    swept(comm, shared_path, FRACTIONS, ranks_per_case=1)
    parallel_assert(comm, times == {p: p.stat().st_mtime_ns for p in shared_path.glob("out/case-*/result.json")})


@pytest.mark.one_rank
def test_mean_of_random_cells_is_isotropic_and_within_the_bounds(comm, shared_path):
    """Between the bounds, and isotropic within its confidence interval: a small one of README's 30 realisations."""
    case = RANDOM.replace("fibres = 3", "fibres = 8").replace("mesh_size = 0.3", "mesh_size = 0.2")
    table = swept(comm, shared_path, "realisations = 12\n", case, ranks_per_case=1)
    s = table.statistics
    for modulus in ("bulk", "shear"):
        lower, upper = (s[f"{modulus}_{side}"].mean[0] for side in ("lower", "upper"))
        assert lower - s[modulus].ci95[0] < s[modulus].mean[0] < upper + s[modulus].ci95[0]
    deviation = table.outputs["C11"] - table.outputs["C22"]
    assert abs(deviation.mean()) < 3.1 * deviation.std(ddof=1) / 12**0.5  # 99 % of Student's t
    assert s["C11"].count.tolist() == [12.0] and s["C11"].std[0] > 0


def test_failed_cases_end_the_sweep_as_one_error(comm, shared_path):
    case = CASE + BY_BODIES + "[petsc]\nfeti_ksp_max_it = 2\n"
    with pytest.raises(ConvergenceError, match="2 of 2 cases failed"):
        swept(comm, shared_path, "cell.fibre_fraction = [0.2, 0.3]\n", case, ranks_per_case=1)
    table = on_root(comm, collect.read, shared_path / "out")
    assert table.status == ["not converged"] * 2 and "no convergence" in table.reason[0]
    entries = on_root(comm, case_folders.read_index, shared_path / "out").entries
    assert [entry.folder for entry in entries] == table.folder


def test_a_case_whose_result_does_not_fit_is_computed_once(comm, shared_path, monkeypatch):
    """A mesh file may change while the sweep runs."""
    monkeypatch.setattr(case_folders, "identity_of", lambda *_: "of another mesh")
    table = swept(comm, shared_path, "'cell.fibre_fraction' = [0.2, 0.3]\n")
    assert table is None or table.status == ["damaged", "damaged"]
