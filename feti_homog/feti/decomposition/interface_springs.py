"""Elastic bonds between bodies: springs of finite stiffness in place of glue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.typing import Float


@dataclass(frozen=True)
class InterfaceSprings:
    """Traction = stiffness x jump at every node that holds, in tension and compression.

    Attributes:
        stiffness: of each interface of the case stress per opening and per slip, or per slip along the fibre;
            infinite ones are glue.
        soften: their compliance may grow while the cell is loaded.
    """

    stiffness: tuple[tuple[float, ...], ...]
    soften: bool = False

    def compliance(self, jump_operator: JumpOperator) -> Float:
        """(owned rows,) C = 1 / (k l) of the rows of interface nodes with the tributary lengths l, 0 of all others."""
        nodes, C = jump_operator.nodes, np.zeros(jump_operator.owned[1] - jump_operator.owned[0])
        for component, stiffness in enumerate(zip(*self.stiffness, strict=True)):
            C[nodes.row + component] = 1.0 / (np.array(stiffness)[nodes.pair] * nodes.length)
        return C


GLUE = InterfaceSprings(())
