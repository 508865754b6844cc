"""The nodes in the middle of the edges of second-order triangles, which say how an edge is bent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.mesh.coarse_mesh import edge_keys
from feti_homog.typing import Float, Int, Int32


@dataclass(frozen=True)
class MiddleNodes:
    """Middle nodes of k sides of triangles; a side of two triangles is listed twice.

    Attributes:
        edges: (k, 2) corner nodes at the ends of each side, numbered from 0.
        tags: (k,) the file's numbers of the middle nodes.
        points: (k, 3) their positions.
    """

    edges: Int32
    tags: Int
    points: Float

    @classmethod
    def none(cls) -> MiddleNodes:
        """Return those of triangles of three nodes."""
        return cls(np.zeros((0, 2), np.int32), np.zeros(0, np.int64), np.zeros((0, 3)))

    def between(self, pairs: Int32) -> Float:
        """(p, 2) the middle node between each pair (p, 2) of corner nodes; NaN where there is none."""
        nodes = int(max(self.edges.max(initial=0), pairs.max(initial=0))) + 1
        keys, first = np.unique(edge_keys(self.edges, nodes), return_index=True)
        wanted = edge_keys(pairs, nodes)
        found = np.full((len(pairs), 2), np.nan)
        if len(keys):
            place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            known = keys[place] == wanted
            found[known] = self.points[first[place[known]], :2]
        return found
