"""Errors that the solver's Python code raises while PETSc calls it leave the solve after PETSc has returned."""

import gc
import weakref

import numpy as np
import pytest
from support.torn_cells import tear

from feti_homog.errors import CaseError
from feti_homog.feti.krylov import PrimalTest
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.operators.preconditioners import StiffnessScaled

pytestmark = [pytest.mark.parallel, pytest.mark.quick]

E11 = np.array([1.0, 0.0, 0.0])
CALLBACKS = [(DualOperator, "apply"), (StiffnessScaled, "apply"), (PrimalTest, "__call__")]


@pytest.mark.parametrize("method", ["cg", "gmres"])
@pytest.mark.parametrize(("context", "function"), CALLBACKS)
def test_the_solve_raises_it_and_the_next_one_works(comm, monkeypatch, method, context, function):
    solver = tear(comm, petsc={"feti_ksp_type": method}).solver
    start, calls = np.zeros(solver.rows), []
    expected = solver.solve(E11, start)
    right = getattr(context, function)

    def refuse_the_third(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise CaseError("refused")
        return right(*arguments)

    monkeypatch.setattr(context, function, refuse_the_third)
    with pytest.raises(CaseError, match="refused"):
        solver.solve(E11, start)
    assert len(calls) == 3
    again = solver.solve(E11, start)
    assert again.iterations == expected.iterations and np.array_equal(again.lam, expected.lam)


def test_a_destroyed_solver_keeps_no_vector_of_petsc(comm):
    """Vectors that only the end of Python frees would make the ranks end PETSc unlike."""
    solver = tear(comm, geometry="square").solver
    solver.solve(np.array([1.0, 0.0, 0.0]), np.zeros(solver.rows))
    krylov = weakref.ref(solver._krylov_for(1))
    solver.destroy()
    gc.collect()
    assert krylov() is None
