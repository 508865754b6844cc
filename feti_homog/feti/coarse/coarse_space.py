"""What the solver asks of a coarse space."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from feti_homog.typing import Float


class CoarseSpace(Protocol):
    """Vectors U that are taken out of the Krylov method by T z = z - U c, with G^T T z = 0 (natural: T = P).

    Arrays are owned rows (rows,) or (rows, k), 0 on inactive ones.  All calls are collective.
    """

    @property
    def coarse_dimension(self) -> int:
        """Dimension of the space that every residual is orthogonal to."""

    @property
    def deflates(self) -> bool:
        """Whether more than rigid-body motions is taken out of the Krylov method."""

    def activate(self, active: Float) -> None:
        """Factor for the owned rows of which `active` (rows,) is 1; the others, 0, carry no multiplier."""

    def project(self, x: Float) -> Float:
        """P x: what no rigid-body motion works on."""

    def deflate(self, z: Float) -> Float:
        """T z: the part of a correction that the Krylov method may use."""

    def project_residual(self, r: Float) -> Float:
        """r - G a: the part of a residual that the Krylov method has to remove."""

    def coarse_initial_guess(
        self, lam: Float, residual: Float, apply_dual: Callable[[Float], Float]
    ) -> tuple[Float, Float]:
        """lam + U c (rows, k) and the residual that it leaves; `apply_dual` is F on the active rows."""

    def disable_deflation(self) -> bool:
        """Fall back to T = P until rows change, after the Krylov method broke down; whether that is a change."""

    def destroy(self) -> None:
        """Free what ranks hold together."""
