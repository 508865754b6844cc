"""The cut cell, on rank 0: from a case to its coarse mesh, and to the pieces of it that each rank gets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.cell.coarse_mesh import CoarseMesh
from feti_homog.cell.fibre_centres import fibre_centres
from feti_homog.cell.periodic_topology import Torus, edge_pairs
from feti_homog.cell.refinement import Lattice
from feti_homog.cell.submesh import Submesh, cut
from feti_homog.config import case as cases
from feti_homog.config.case import Case
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition.partition import decompose, pieces_for_count, pieces_for_size
from feti_homog.feti.decomposition.shared_entities import SharedEntities, share
from feti_homog.interface import debonded_arcs
from feti_homog.typing import Float, Int

# Degrees of freedom of a piece that make set-up and solve fastest, unless there would be more than so many pieces: the
# coarse problem grows faster than they do; a piece gets `NARROW` of its boundary to other bodies at most.  A body is
# cut that is larger than a piece by a factor, or, where bonds break, whose boundary is too long for dense matrices.
FASTEST, MOST, NARROW, LARGE, WIDE = 3000, 4000, 500, 2.5, 2500
# Bodies of short boundary stay whole up to a larger factor, if they are no more than a fraction of a rank's load.
LARGEST, FRACTION = 12.0, 1 / 16
FIBRES_OF = {"square": 1, "hexagonal": 2}


@dataclass(frozen=True)
class Plan:
    """What rank 0 tells every rank of the whole cell.

    Fibre number 1 of the case file is the constituent `first_fibre`; `centres` (constituents, 2) are NaN where
    there is none.
    """

    width: float
    height: float
    phases: tuple[str, ...]
    bodies: int
    subdomains: int
    coarse_triangles: int
    first_fibre: int
    centres: Float

    @property
    def period(self) -> Float:
        """(2,) width and height."""
        return np.array([self.width, self.height])

    @property
    def area(self) -> float:
        """|UC|."""
        return self.width * self.height


def coarse_mesh(case: Case) -> CoarseMesh:
    """The coarse mesh that the case describes, its phases checked against the materials."""
    # gmsh is loaded where it is used: only rank 0 has use for it.
    if case.cell.file is not None:
        from feti_homog.cell.msh_reader import read

        mesh = read(case.cell.file)
    else:
        from feti_homog.cell.gmsh_mesher import generate

        fibres = case.cell.fibres or FIBRES_OF[case.cell.geometry]
        mesh = generate(case.cell, debonded_arcs.tips(case.arcs, case.angle.values if case.angle else (), fibres))
    cases.check_phases(case, mesh.phases)
    return mesh


def deal(
    case: Case, mesh: CoarseMesh, lattice: Lattice, n_ranks: int
) -> list[tuple[Plan, list[Submesh], SharedEntities]]:
    """For each rank: the plan, its pieces and the table of what they share with others."""
    torus = Torus.of(mesh)
    first_fibre = int(np.count_nonzero(torus.constituent_phase == 0))
    centres = fibre_centres(torus)
    faults = debonded_arcs.faults(case.arcs, centres[first_fibre:])
    if faults:
        raise CaseError(*faults)
    parts = torus.constituent if case.cell.bodies == "torus" else torus.plane_parts()
    wanted = wanted_pieces(case, np.bincount(parts), _outer_edges(torus, parts), lattice, n_ranks)
    decomposition = decompose(torus, parts, wanted, n_ranks)
    pieces = list(cut(torus, decomposition.subdomain))
    tables = share(torus, pieces, decomposition.rank, lattice.intervals - 1, n_ranks)
    bodies = int(parts.max()) + 1
    plan = Plan(mesh.width, mesh.height, mesh.phases, bodies, len(pieces), len(mesh.triangles), first_fibre, centres)
    own: list[list[Submesh]] = [[] for _ in range(n_ranks)]
    for submesh, rank in zip(pieces, decomposition.rank, strict=True):
        own[rank].append(submesh)
    return list(zip([plan] * n_ranks, own, tables, strict=True))


def wanted_pieces(case: Case, load: Int, edges: Int, lattice: Lattice, n_ranks: int) -> Int:
    """Wanted pieces of each body of `load` coarse triangles and `edges` coarse edges to others.

    As the case says; else large bodies are cut to the size that is fastest, and every rank gets a piece.
    """
    wanted = case.decomposition
    # A triangle of the lattice brings about M^2 / 2 nodes.
    dofs_of_triangle = lattice.intervals**2
    if wanted.max_dofs is not None:
        return pieces_for_size(load, dofs_of_triangle, wanted.max_dofs)
    if wanted.subdomains is not None:
        return pieces_for_count(load, wanted.subdomains)
    # A debonding cell is solved so often that whole bodies pay, as long as their dense matrices are small.
    size = max(FASTEST, int(load.sum()) * dofs_of_triangle // MOST)
    boundary = edges * 2 * lattice.intervals
    share = int(load.sum()) * dofs_of_triangle / n_ranks
    whole = max(LARGE * size, min(LARGEST * size, FRACTION * share))
    large = (load * dofs_of_triangle > whole) | (boundary > LARGE * NARROW)
    if case.interface is not None:
        large = boundary > WIDE
    by_size = pieces_for_size(load, dofs_of_triangle, size)
    by_boundary = np.minimum(-(-boundary // NARROW), load)
    pieces = np.where(large, np.maximum(by_size, by_boundary), 1)
    return pieces if pieces.sum() >= n_ranks else pieces_for_count(load, n_ranks)


def _outer_edges(torus: Torus, parts: Int) -> Int:
    """(b,) coarse edges of each body that others share."""
    left, right = edge_pairs(torus.triangle_torus_edges)
    outer = parts[left] != parts[right]
    return np.bincount(np.r_[parts[left[outer]], parts[right[outer]]], minlength=int(parts.max()) + 1)
