"""A refined coarse triangle as one element: which lattice nodes couple, and the integrals that affine images share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from feti_homog.fem.shape_functions import gradients
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class GroupedSum:
    """Sums of the element matrices' entries of one coarse triangle that belong together.

    Attributes:
        entries: all entries, flat, those that belong together one after the other.
        first: where each sum begins in `entries`.
    """

    entries: Int
    first: Int

    @classmethod
    def of(cls, target: Int) -> GroupedSum:
        """One sum for each value of `target`, which says where an entry belongs, in ascending order."""
        entries = np.argsort(target, axis=None, kind="stable")
        return cls(entries, np.unique(target.ravel()[entries], return_index=True)[1])

    def __call__(self, values: Float) -> Float:
        """(t, sums, k) from the entries (.., k) of t coarse triangles."""
        each = values.reshape(-1, len(self.entries), values.shape[-1])
        return np.add.reduceat(each[:, self.entries], self.first, axis=1)


@dataclass(frozen=True)
class MacroElement:
    """The lattice with q nodes as an element whose nodes couple in p ordered pairs, those that share an element.

    Attributes:
        rows, columns: (p,) lattice nodes of each couple, in row-major order.
        couples: from the entries (4**refine, a, a) of the element matrices to the couples.
        nodes: from the nodes (4**refine, a) of the elements to those of the lattice.
        products: (p, 4) int dN_A/dr_k dN_B/dr_l over the unit triangle, with (k, l) flat.
        integrals: (q, 2) int dN_A/dr_k over the unit triangle.
    """

    rows: Int
    columns: Int
    couples: GroupedSum
    nodes: GroupedSum
    products: Float
    integrals: Float

    @classmethod
    @lru_cache(maxsize=4)
    def of(cls, lattice: ReferenceLattice) -> MacroElement:
        """The element of a lattice."""
        elements, q = lattice.triangles, len(lattice.nodes)
        pair = elements[:, :, None] * q + elements[:, None, :]
        couples, nodes, each = GroupedSum.of(pair), GroupedSum.of(elements), np.unique(pair)
        g, w = gradients(lattice.nodes[elements][..., 1:] / lattice.intervals)
        return cls(each // q, each % q, couples, nodes, couples(products(g, w))[0], nodes(integrals(g, w))[0])


def products(g: Float, w: Float) -> Float:
    """(e, a, a, 4) int dN_a/dx_k dN_b/dx_l, with (k, l) flat, from gradients (e, q, a, 2) and weights (e, q)."""
    e, q, a, _ = g.shape
    flat = g.reshape(e, q, 2 * a)
    outer = np.matmul((flat * w[..., None]).transpose(0, 2, 1), flat)
    return np.asarray(outer.reshape(e, a, 2, a, 2).transpose(0, 1, 3, 2, 4).reshape(e, a, a, 4))


def integrals(g: Float, w: Float) -> Float:
    """(e, a, 2) int dN_a/dx_k, from the same."""
    integral: Float = np.einsum("eqak,eq->eak", g, w)
    return integral
