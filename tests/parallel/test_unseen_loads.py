"""Loads of which the active rows see rounding alone: a coated fibre that nothing holds, with phases 1000 apart."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.dimensions import Units

from feti_homog import run
from feti_homog.case import cases
from feti_homog.feti.dual_solution import ActiveJumps
from feti_homog.feti.solver import FetiSolver

pytestmark = pytest.mark.parallel

DOCUMENT = {
    "cell": {"geometry": "square", "order": 2, "bodies": "plane", "fibre_fraction": 0.214, "coating": 0.2,
             "mesh_size": 0.398},
    "material": {"matrix": {"young": 1.16, "poisson": 0.118}, "fibre": {"young": 0.117, "poisson": 0.148},
                 "coating": {"young": 80.0, "poisson": 0.3}},
    "analysis": {"type": "load", "plane": "strain"},
    "load": {"to": {"E11": 0.0037, "E22": -0.0108}},
    "interface": [
        {"contact": False, "normal_stiffness": 6.1, "tangential_stiffness": 71.0, "between": ["coating", "matrix"],
         "debonded": [{"fibre": 1, "centre": 176.4, "angle": 360.0}]},
        {"contact": False, "normal_stiffness": 49.4, "tangential_stiffness": 174.6, "between": ["coating", "fibre"],
         "debonded": [{"fibre": "all", "centre": -84.8, "angle": 134.3}]},
    ],
    "decomposition": {"subdomains": 4},
    "output": {"pictures": False},
    "petsc": {"feti_ksp_rtol": 1e-12, "feti_pc_type": "lumped"},
}  # fmt: skip
UNITS = 1.0, 11.985837666469678, 1e17


@pytest.fixture
def solutions(monkeypatch):
    """All that the solver finds."""
    found = []
    solve = FetiSolver.solve_many

    def recorded(*arguments):
        own = solve(*arguments)
        found.extend(own)
        return own

    monkeypatch.setattr(FetiSolver, "solve_many", recorded)
    return found


@pytest.mark.parametrize("unit", UNITS)
def test_they_have_no_multipliers(comm, solutions, unit):
    run(cases.parse(Units(stress=unit).case(DOCUMENT), Path()), comm)
    assert solutions
    for solution in solutions:
        assert not solution.lam.any()
        assert solution.iterations == 0
        assert solution.residual <= 1


@pytest.mark.parametrize("unit", UNITS)
def test_jumps_of_rounding_are_jumps_that_multipliers_can_close(comm, solutions, monkeypatch, unit):
    """Were they not in the range of the projector, the Krylov method would not converge."""
    monkeypatch.setattr(ActiveJumps, "rounding", lambda *arguments: np.zeros_like(arguments[-1]))
    run(cases.parse(Units(stress=unit).case(DOCUMENT), Path()), comm)
    assert comm.allreduce(any(solution.lam.any() for solution in solutions), MPI.LOR)
    assert all(solution.reason > 0 and solution.iterations < 200 for solution in solutions)


@pytest.mark.parametrize("share", [1e-7, 1e-10])
def test_small_jumps_of_a_bonded_cell_are_seen(comm, solutions, share, monkeypatch):
    """Rows see a small share of the jumps of the torn cell where most of these are motions of bodies as a whole."""
    found = []
    measured = ActiveJumps.rounding

    def rounding(self, displacement, loads, seen, torn):
        found.append(measured(self, displacement, loads, share * torn, torn) / torn)
        return measured(self, displacement, loads, seen, torn)

    monkeypatch.setattr(ActiveJumps, "rounding", rounding)
    run(cases.parse({k: v for k, v in DOCUMENT.items() if k != "interface"}, Path()), comm)
    assert np.max(found) < share
    assert all(solution.iterations > 0 for solution in solutions)
