"""Recovered stresses that obey the tractions on a boundary where these are known.

There fits have elements on one side alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Float, Int

# Length of the mean of the normals of the sides at a vertex below which it has no direction: sides meet in a cusp, as
# where two fibres touch.
NO_NORMAL = 0.1


@dataclass(frozen=True)
class KnownTractions:
    """Tractions of k loads at n vertices.

    Attributes:
        node: (n,) their classes of nodes.
        normal: (n, 2) unit vectors out of the body.
        traction: (n, c, k).
    """

    node: Int
    normal: Float
    traction: Float

    @classmethod
    def at(cls, node: Int, mean: Float, traction: Float) -> KnownTractions:
        """Make them of the mean normals (n, 2) of the sides at vertices, but for those at which these cancel."""
        length = np.hypot(*mean.T)
        kept = length > NO_NORMAL
        return cls(node[kept], mean[kept] / length[kept, None], traction[kept])

    def imposed(self, stress: Float, vertex: Int, voigt: Int, flexibility: Float) -> Float:
        """Return stresses (vertices, m, k) with these tractions at `vertex` (n,).

        Of components `voigt` (c, 2) and a flexibility (m, m).

        sigma + d n + n d - (d . n) n n + a t t in the plane, with d = traction - sigma n and a such that the strain
        along the boundary stays, as it is known on both of its sides; along the fibres sigma + d n.
        """
        n, own = self.normal, stress[vertex]
        d = self.traction - np.einsum("ncdk,nd->nck", own[:, voigt], n)
        off = np.einsum("nck,nd->ncdk", d, n)
        entries = [tuple(np.argwhere(voigt == number)[0]) for number in range(stress.shape[1])]
        if len(voigt) == 2:
            both = n[:, :, None, None] * n[:, None, :, None]
            off += off.transpose(0, 2, 1, 3) - both * np.einsum("nck,nc->nk", d, n)[:, None, None]
        found = np.stack([off[:, i, j] for i, j in entries], axis=1)
        if len(voigt) == 2:
            t = np.column_stack([-n[:, 1], n[:, 0]])
            along = np.stack([t[:, i] * t[:, j] for i, j in entries], axis=1)
            strain = along @ flexibility
            share = np.einsum("nv,nvk->nk", strain, found) / (strain * along).sum(axis=1)[:, None]
            found -= along[..., None] * share[:, None]
        whole = stress.copy()
        whole[vertex] += found
        return whole
