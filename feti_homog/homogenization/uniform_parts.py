"""Parts of subdomains that lie in one body each, for averages of phases and estimates.

A subdomain of one material is a part itself; one across materials has a part for each body that it reaches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fem.problem import Problem
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.mesh.refinement import FineMesh
from feti_homog.mesh.submesh import Submesh, part
from feti_homog.typing import Float, Int


@dataclass(frozen=True, eq=False)
class UniformPart:
    """A part of a subdomain, of one material.

    Attributes:
        place: of the subdomain among those of its rank.
        submesh, mesh: of the part; the index is that of the subdomain.
        dofs: (cn,) the degrees of freedom of the subdomain that are the part's.
        L, problem, is_mixed: as of `Subdomain`.
    """

    place: int
    submesh: Submesh
    mesh: FineMesh
    dofs: Int
    L: Float
    problem: Problem
    is_mixed: bool


def parts_of(subdomains: Sequence[Subdomain], phase_of: Sequence[str]) -> Iterator[UniformPart]:
    """Yield the parts of one subdomain after the other, those of one phase together.

    `phase_of` (constituents,) are the names of phases.
    """
    for place, s in enumerate(subdomains):
        if s.material is None:
            yield UniformPart(place, s.submesh, s.mesh, np.arange(s.n_dofs), s.L, s.problem, s.is_mixed)
            continue
        order = np.lexsort((s.submesh.constituent, s.material))
        bodies = s.submesh.constituent[order]
        for members in np.split(order, np.flatnonzero(np.diff(bodies)) + 1):
            body, law = int(s.submesh.constituent[members[0]]), s.laws[s.material[members[0]]]
            submesh = replace(part(s.submesh, members), body=body, phase=phase_of[body])
            mesh, classes = _restricted(s.mesh, members)
            yield UniformPart(place, submesh, mesh, s.problem.dofs(classes), law, s.problem, s.is_mixed)


def _restricted(mesh: FineMesh, members: Int) -> tuple[FineMesh, Int]:
    """Return the coarse triangles `members` (t,) of a mesh as a mesh of its own, and (c,) the classes that it has."""
    nodes, local = np.unique(mesh.nodes[members], return_inverse=True)
    classes, node_class = np.unique(mesh.node_class[nodes], return_inverse=True)
    own = local.reshape(len(members), -1).astype(np.int32), node_class.astype(np.int32)
    return FineMesh(mesh.points[nodes], own[0], mesh.curved[members], own[1], len(classes), mesh.lattice), classes
