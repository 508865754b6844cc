"""The Dirichlet preconditioner whose displacements are balanced by the adaptive coarse space."""

from __future__ import annotations

import numpy as np

from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace
from feti_homog.feti.preconditioners.scaled import Dirichlet, never_softens
from feti_homog.typing import Float


class Balanced:
    """z = B_D S_0 B_D^T r with S_0 of `coarse`, the rest as in `scaled`.

    S_0 B_D^T B R = S_0 R = 0 for rigid-body motions R: so G^T z = 0, and a part G a of r makes no z.

    Attributes:
        scaled: the preconditioner without coarse space.
        coarse: the coarse space.
    """

    norm, soften = np.inf, never_softens

    def __init__(self, scaled: Dirichlet, coarse: AdaptiveCoarseSpace) -> None:
        self.scaled, self.coarse = scaled, coarse

    def activate(self, active: Float) -> None:
        """Restrict both to the rows where `active` is 1.  Collective."""
        self.scaled.activate(active)
        self.coarse.activate(active)

    def apply(self, r: Float) -> Float:
        """B_D S_0 B_D^T r.  Collective."""
        return self.scaled.multipliers(self.coarse.balanced(self.scaled.displacement_with_jump(r)))

    def close(self, right: Float, d: Float, E: Float) -> Float:
        """B_D S B_D^T of `right`: the forces that close the torn cell before its coarse displacements give way."""
        return self.scaled.apply(right)

    def initial_multipliers(self, previous: Float, closing: Float) -> Float:
        """The previous ones."""
        return previous
