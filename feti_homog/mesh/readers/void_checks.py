"""The checks of a user's mesh that may have voids: where there are no triangles."""

from __future__ import annotations

import numpy as np

from feti_homog.mesh.coarse_mesh import CoarseMesh, areas, edge_keys, edges, void_edges
from feti_homog.mesh.periodic_topology import Torus, components, edge_pairs
from feti_homog.mesh.readers.mesh_checks import SIDES, RawMesh, first_of
from feti_homog.typing import Bool, Int32

# Share of the cell that rounding of coordinates may leave uncovered.
ROUNDING = 1e-6


def unmatched_sides(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """Edges on a side of the cell whose image on the opposite side is no edge: a void lies along the side."""
    pairs = edges(mesh.triangles)
    faults = []
    for axis in (0, 1):
        on = [np.all(mesh.points[pairs, axis] == level, axis=1) for level in (0.0, mesh.period[axis])]
        keys = [edge_keys(mesh.representative[pairs[own]].astype(np.int32), len(mesh.points)) for own in on]
        for here in (0, 1):
            alone = pairs[on[here]][~np.isin(keys[here], keys[1 - here])]
            if len(alone):
                sides = f"edges of the {SIDES[axis, here]} side have no partner on the {SIDES[axis, 1 - here]} side"
                faults.append(f"not periodic, {sides}: {first_of(map(raw.edge, alone), len(alone))}")
    return faults


def islands(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """Parts of the mesh that share no edge with the largest: nothing would hold them."""
    part = components(len(mesh.triangles), *edge_pairs(Torus.of(mesh).triangle_torus_edges))
    loose = np.flatnonzero(part != np.bincount(part).argmax())
    first = loose[np.unique(part[loose], return_index=True)[1]]
    held = "floating parts, which voids part from all others"
    return [f"{held}: that with {first_of(map(raw.element, first), len(first))}"] if len(first) else []


def no_voids(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """Edges beside voids that have no area, and what is not meshed without such edges."""
    pairs, empty = void_edges(mesh), 1.0 - areas(mesh.points, mesh.triangles).sum() / mesh.period.prod()
    if len(pairs) == 0:
        return [f"the elements leave {empty:.3g} of the cell uncovered"] if empty > ROUNDING else []
    crowded = pairs[_is_crowded(mesh, pairs)]
    names = first_of(map(raw.edge, crowded), len(crowded))
    touching = [f"voids that touch in a node, as at {names}"] if len(crowded) else []
    slits = first_of(map(raw.edge, pairs), len(pairs), shown=2)
    return touching + ([f"voids without an area, beside {slits}"] if empty < ROUNDING else [])


def _is_crowded(mesh: CoarseMesh, pairs: Int32) -> Bool:
    """(k,) whether an end of each edge beside a void has more than two of them."""
    ends = mesh.representative[pairs]
    return np.asarray((np.bincount(ends.ravel(), minlength=len(mesh.points))[ends] > 2).any(axis=1))
