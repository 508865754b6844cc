"""The inverse of the projected dual operator of cells of few large subdomains in which nothing parts."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.exact.reference_cell import ReferenceCell, one_sided_jumps
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur, assembled_stiffness
from feti_homog.feti.preconditioners.scaled import Preconditioner, never_softens
from feti_homog.system.parallel.distributed_arrays import scale_rows
from feti_homog.typing import Float


class BondedInverse(Preconditioner):
    """z = H r by the factor of the assembled Schur complement: nothing is left to iterate.

    `ExactInverse` without what follows rows that leave and come: another set of active rows is factored anew.
    """

    norm, soften, is_exact = np.inf, never_softens, True

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds; all boundary operators must be dense.  Collective."""
        self._comm, self._jump_operator, self._operators = comm, jump_operator, operators
        self._one_sided = one_sided_jumps(comm, jump_operator, operators)
        first, end = jump_operator.owned
        self._cell = self._bonded(np.ones(end - first))

    def _bonded(self, active: Float) -> ReferenceCell:
        """Return the cell with these bonds, all parts of it at once.  Collective."""
        parts = self._comm, self._jump_operator, self._operators
        stages = assembled_stiffness(*parts, active)
        while True:
            try:
                next(stages)
            except StopIteration as end:
                return ReferenceCell(*parts, self._one_sided, active, AssembledSchur(self._comm, *end.value))

    def activate(self, active: Float) -> None:
        """Factor the cell with these bonds, which must hold all bodies, unless it is."""
        if self._comm.allreduce(bool((active != self._cell.active).any()), MPI.LOR):
            self._cell.destroy()
            self._cell = self._bonded(active)

    def apply(self, r: Float) -> Float:
        """Return the multipliers that close the jump r on the active rows."""
        return self._cell.respond(scale_rows(self._cell.active, r))
