"""Fits of stresses about vertices that pieces of one body share: patches are those of the body, not of its pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fem.local_fits import Neighbours, fitted
from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.homogenization.shared_vertices import SharedVertices
from feti_homog.typing import Bool, Float, Int

# Layers of elements about shared vertices: these, their neighbours, and the neighbours of these have all of theirs.
LAYERS = 3


def fits_across_cuts(shared: SharedVertices, bodies: Sequence[RecoveredStress]) -> dict[int, tuple[Int, Float]]:
    """Return, by the mesh, classes of vertices (n,) and the fits (n, p, m k) that cuts change.  Collective."""
    pieces = zip(shared.meshes, shared.classes, shared.sides, shared.is_first, strict=True)
    strips = [_Strip.of(bodies[mesh], classes, sides, first) for mesh, classes, sides, first in pieces]
    own = _over_pieces(shared, strips, [strip.stress.patch_sums() for strip in strips])
    flags = shared.sum([np.isin(strip.shared, strip.bounds)[:, None].astype(float) for strip in strips])
    neighbours = [strip.neighbours(flag[:, 0] > 0) for strip, flag in zip(strips, flags, strict=True)]
    order = bodies[0].order if bodies else 1
    near = [
        (n.shared_matrices(moments, order), n.shared(sums, order))
        for n, (moments, sums) in zip(neighbours, own, strict=True)
    ]
    found = {}
    added = _over_pieces(shared, strips, near)
    for mesh, strip, n, ours, theirs in zip(shared.meshes, strips, neighbours, own, added, strict=True):
        changed = np.union1d(strip.shared, n.at[np.isin(n.other, strip.shared)])
        fits = fitted(*(a[changed] + b[changed] for a, b in zip(ours, theirs, strict=True)))
        found[mesh] = np.flatnonzero(strip.is_vertex)[changed], fits
    return found


@dataclass(frozen=True)
class _Strip:
    """The elements about the shared vertices of one mesh, whose vertices are numbered from 0.

    Attributes:
        stress: on these elements alone.
        is_vertex: (classes,) whether they have each.
        shared: (n,) the shared vertices.
        sides: (f, 2) those of elements, each once in its body; `vector` (f, 2) from the first vertex to the second.
        bounds: (b,) vertices at which a side has no other element of the body.
    """

    stress: RecoveredStress
    is_vertex: Bool
    shared: Int
    sides: Int
    vector: Float
    bounds: Int

    @classmethod
    def of(cls, body: RecoveredStress, classes: Int, cut: Int, is_first: Bool) -> _Strip:
        """Find it; `cut` (c, 2) are the sides on cuts, of which others count all but the first."""
        is_vertex, at = np.zeros(len(body.u), bool), body.node_class[body.triangles[:, :3]]
        is_vertex[classes] = True
        for _ in range(LAYERS):
            near = is_vertex[at].any(axis=1)
            is_vertex[at[near]] = True
        stress = replace(body, triangles=body.triangles[near])
        corners, size = stress.points[stress.triangles[:, :3]], int(is_vertex.sum())
        start, stop = stress.vertices.ravel(), stress.vertices[:, [1, 2, 0]].ravel()
        vector = (corners[:, [1, 2, 0]] - corners).reshape(-1, 2)
        code, once, count = np.unique(_code(start, stop, size), return_index=True, return_counts=True)
        on_cut = _code(stress.numbers[cut[:, 0]], stress.numbers[cut[:, 1]], size)
        single = once[(count == 1) & ~np.isin(code, on_cut)]
        once = once[~np.isin(code, on_cut[~is_first])]
        sides = np.stack([start, stop], axis=1)
        return cls(stress, is_vertex, stress.numbers[classes], sides[once], vector[once], np.unique(sides[single]))

    def neighbours(self, at_boundary: Bool) -> Neighbours:
        """Return pairs whose first is on the boundary of the body, as shared vertices (n,) are if `at_boundary`."""
        wanted = np.zeros(int(self.is_vertex.sum()), bool)
        wanted[self.bounds] = True
        wanted[self.shared] = at_boundary
        at, other = np.concatenate([self.sides, self.sides[:, ::-1]]).T
        vector = np.concatenate([self.vector, -self.vector])
        return Neighbours(at[wanted[at]], other[wanted[at]], vector[wanted[at]])


def _code(a: Int, b: Int, size: int) -> Int:
    """Return one number for each pair of vertices, of `size` in all."""
    return np.asarray(np.minimum(a, b) * size + np.maximum(a, b))


def _over_pieces(
    shared: SharedVertices, strips: Sequence[_Strip], pairs: Sequence[tuple[Float, Float]]
) -> list[tuple[Float, Float]]:
    """Return moments and sums (vertices, p, ..) of strips with those of all pieces at shared vertices.  Collective."""
    parts = [
        np.concatenate([each[strip.shared] for each in own], axis=2) for strip, own in zip(strips, pairs, strict=True)
    ]
    whole = shared.sum([part.reshape(len(part), -1) for part in parts])
    for strip, (moments, sums), part, summed in zip(strips, pairs, parts, whole, strict=True):
        p = moments.shape[1]
        moments[strip.shared], sums[strip.shared] = np.split(summed.reshape(part.shape), [p], axis=2)
    return list(pairs)
