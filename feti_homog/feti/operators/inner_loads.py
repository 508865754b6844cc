"""The unit loads condensed to the boundaries.

Loads vanish inside uniform bodies but for nodes at voids.  With K_ii u_i = -Q_i E - K_ib u_b the stress integral is
C E + q^T u_b and the forces on the boundary are S u_b + q E, of

    q = Q_b - K_bi K_ii^-1 Q_i,  C = |Omega| L - Q_i^T K_ii^-1 Q_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators.implicit import Interior
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class CondensedLoads:
    """Of the subdomains of this rank, under v unit loads.

    Attributes:
        boundary: (boundary dofs, v) q.
        stiffness: (v, v) sum of C.
        inner: of the subdomains beside voids, by their places, (their dofs, v) -K_ii^-1 Q_i, 0 on the boundary.
    """

    boundary: Float
    stiffness: Float
    inner: dict[int, Float]

    @classmethod
    def of(cls, subdomains: Sequence[Subdomain], dofs: Sequence[Int], loads: int) -> CondensedLoads:
        """Condense to the `dofs` of each subdomain; interiors beside voids are factored for it and not kept."""
        boundary, stiffness = [np.zeros((0, loads))], np.zeros((loads, loads))
        inner: dict[int, Float] = {}
        for place, (s, own) in enumerate(zip(subdomains, dofs, strict=True)):
            q, C = s.Q[own], s.area * s.L
            if s.submesh.at_void.any():
                u = inner[place] = np.zeros(s.Q.shape)
                interior = Interior(s.assemble_stiffness(), own)
                u[interior.dofs] = interior.solve(-s.Q[interior.dofs])
                q, C = q + interior.coupling @ u[interior.dofs], C + s.Q.T @ u
            boundary.append(q)
            stiffness += C
        return cls(np.concatenate(boundary), stiffness, inner)
