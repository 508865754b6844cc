"""Solution of the dual problem."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.typing import Float


@dataclass(frozen=True)
class DualSolution:
    """The multipliers under one macroscopic strain and what follows from them on the interface.

    Attributes:
        strain: (v,) E, of plane strain (3,); with the other loads of the problem.
        lam: (owned rows,) multipliers, nodal forces between the faces; 0 on inactive rows.
        jump: (owned rows,) B u* - C lam, 0 up to tolerance on active rows, gap and slip on the others.
        alpha: (kernel dimension,) rigid-body amplitudes; None of multipliers that F lambda did not confirm.
        iterations, reason: of the Krylov method (PETSc's KSPConvergedReason).
        residual: |B u* - C lam| on the active rows, relative to the jump of the torn cell; of the last solution
            that F lambda confirmed, if not of this one.
        compliance: (owned rows,) C of the springs in this state.
    """

    strain: Float
    lam: Float
    jump: Float
    alpha: Float | None
    iterations: int
    reason: int
    residual: float
    compliance: Float

    @property
    def opening(self) -> Float:
        """(owned rows,) B u*: what the springs give way, and the jump of rows without multipliers."""
        return self.jump + self.compliance * self.lam
