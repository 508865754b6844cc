"""The cut cell, on rank 0: from a case to its coarse mesh, and to the submeshes that each rank gets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition.partition import decompose, pieces_for_count, pieces_for_size
from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.homogenization import arc_selection, cell_remarks, process_zone
from feti_homog.homogenization.arc_selection import InterfaceNodes
from feti_homog.homogenization.cell_remarks import mesh_remarks, subdomain_remarks, table_remarks
from feti_homog.interface.tips import debonded_arcs
from feti_homog.interface.tips.debonded_arcs import MovedTips
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.interface_edges import voids
from feti_homog.mesh.mesh_fibres import coating_thickness, fibre_circles, fibre_frames, fibre_numbers
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.submesh import SubdomainTable, SubmeshesOfRank, cut_for_ranks, pinned_class
from feti_homog.mesh.tiles.tiles import DEFAULT_TILES, TilePolicy
from feti_homog.typing import Bool, Float, Int

ROUNDING = 1e-9  # of coordinates, relative to the cell


@dataclass(frozen=True)
class PartitionPolicy:
    """Into how many pieces the mesh and bodies are cut by default; sizes in degrees of freedom after refinement.

    Attributes:
        piece_dofs: of a piece; with smaller pieces the coarse problem takes longer, with larger ones the factors and
            the dense matrices do.
        piece_boundary_dofs: of a piece on the boundary to other bodies, at most; for pieces of narrow bodies.
        cut_factor: a bonded body is cut if it is larger than a piece by this factor, or its boundary to other bodies is
            than that of a piece.
        even_cut_factor, even_share: instead of `cut_factor`, this one for bodies that are no more than this share of
            the load of a rank, for they can be distributed evenly as they are.
        breakable_boundary_dofs: where bonds may break, a body is cut only if its boundary has more: the cell is solved
            so often then that whole bodies pay as long as dense matrices of their boundaries are small.
        tiles: of the coarse mesh.

    `scripts/benchmark scripts/cases/benchmark_1m.toml --tools feti` times the bonded ones, and `scripts/benchmark_path`
    the last.
    """

    piece_dofs: int = 2200
    piece_boundary_dofs: int = 500
    cut_factor: float = 2.5
    even_cut_factor: float = 16.0
    even_share: float = 1 / 16
    breakable_boundary_dofs: int = 2500
    tiles: TilePolicy = DEFAULT_TILES


DEFAULT_POLICY = PartitionPolicy()


@dataclass(frozen=True)
class CellSummary:
    """Data of the whole cell, known to every rank.

    Attributes:
        width, height: periods.
        phases: names of the material phases, the matrix first.
        bodies, subdomains, coarse_triangles: numbers of them.
        interface_edge: longest coarse edge between phases.
        numbers: (constituents,) of the fibre that each is, from 1 as in case files, or that it coats; 0 of the matrix.
        is_fibre: (constituents,) which are fibres: neither the matrix nor a coating of one.
        constituent_phase: (constituents,) place of the phase of each in `phases`.
        centres, radii: (constituents, 2) and (constituents,) centre, within the cell, and radius of each fibre, NaN
            where there is none.
        frames: (constituents, 2, 2) those of `Ellipses`, of fibres that are circles or ellipses; else NaN.
        snapped: how far a node of a user's mesh was moved to make sides match, at most.
        voids: how many there are.
        match_distance: how far the fibres are from the table that they match, see `neighbour_match`; None without one.
        remarks: how the cell differs from what the case may lead to expect, a line each.
    """

    width: float
    height: float
    phases: tuple[str, ...]
    bodies: int
    subdomains: int
    coarse_triangles: int
    interface_edge: float
    numbers: Int
    is_fibre: Bool
    constituent_phase: Int
    centres: Float
    radii: Float
    frames: Float
    moved_tips: tuple[MovedTips, ...]
    snapped: float
    voids: int
    match_distance: float | None
    remarks: tuple[str, ...]

    @property
    def fibres(self) -> int:
        """Number of fibres."""
        return int(self.is_fibre.sum())

    @property
    def fibre_bodies(self) -> Int:
        """(fibres,) the constituents that are fibres, in the order of their numbers."""
        return np.flatnonzero(self.is_fibre)

    @property
    def coatings(self) -> Float:
        """(fibres,) thickness of their coatings, 0 without one; NaN where they are not round."""
        return coating_thickness(self.numbers, self.is_fibre, Ellipses(self.centres, self.frames).semi_axes)

    def fibre_number(self, constituent: Int) -> Int:
        """(k,) numbers from 1 of the fibres that are these constituents (k,) or that these coat.

        They are those that a case file has; 0 of the matrix.
        """
        return np.asarray(self.numbers[constituent])

    def warnings(self) -> list[str]:
        """List the changes made to a user's mesh."""
        moved = f"nodes on the sides of the mesh were moved by up to {self.snapped:.3g} to match"
        return [moved] if self.snapped > 0 else []

    @property
    def period(self) -> Float:
        """(2,) width and height."""
        return np.array([self.width, self.height])

    @property
    def area(self) -> float:
        """|UC|."""
        return self.width * self.height


@dataclass(frozen=True)
class RankShare:
    """Share of one rank in the cut cell.

    Attributes:
        summary, table: of the whole cell.
        pairs: (phases, phases) as in `cell_remarks.pairs_of`.
        submeshes: those of the rank.
    """

    summary: CellSummary
    table: SubdomainTable
    pairs: Int
    submeshes: SubmeshesOfRank


def distribute(
    case: Case, mesh: CoarseMesh, lattice: ReferenceLattice, n_ranks: int, policy: PartitionPolicy = DEFAULT_POLICY
) -> list[RankShare]:
    """Cut the cell into subdomains and share them among the ranks; one share for each rank.

    Raises:
        CaseError: an arc of the case lies on a fibre that cannot have it, or selects no node.
    """
    torus = Torus.of(mesh)
    numbers, is_fibre = fibre_numbers(torus)
    pairs = cell_remarks.pairs_of(case, mesh.phases)
    circles = fibre_circles(torus)
    centres = in_cell(circles[:, :2], mesh.period)
    touching = (mesh.phase[each] for each in torus.sides[:2])
    faults = cell_remarks.faults(case, mesh.phases, *touching) + arc_selection.fibre_faults(case, centres[is_fibre])
    moved = (debonded_arcs.NOT_MOVED,) * len(case.interfaces)
    if case.arcs and not faults:
        nodes = InterfaceNodes.of(torus, lattice, pairs, numbers, centres)
        moved = nodes.moved_tips(case, int(is_fibre.sum()))
        faults = arc_selection.faults(case, nodes, moved)
    if faults:
        raise CaseError(*faults)
    parts = torus.constituent if case.cell.bodies == "torus" else torus.plane_parts()
    wanted = wanted_pieces(case, np.bincount(parts), _outer_edges(torus, parts), lattice, n_ranks, policy)
    decomposition = decompose(torus, parts, wanted, n_ranks)
    subdomain, rank = decomposition.subdomain, decomposition.rank
    table = SubdomainTable.of(torus, subdomain, rank)
    bodies, triangles = int(parts.max()) + 1, len(mesh.triangles)
    summary = CellSummary(
        width=mesh.width,
        height=mesh.height,
        phases=mesh.phases,
        bodies=bodies,
        subdomains=len(rank),
        coarse_triangles=triangles,
        interface_edge=process_zone.longest_edge(mesh),
        numbers=numbers,
        is_fibre=is_fibre,
        constituent_phase=torus.constituent_phase,
        centres=centres,
        radii=circles[:, 2],
        frames=fibre_frames(torus),
        moved_tips=tuple(map(dict, moved)),
        snapped=mesh.snapped,
        voids=voids(mesh) if torus.at_void.any() else 0,
        match_distance=match_distance(case, mesh.width, mesh.height, centres[is_fibre], circles[is_fibre, 2]),
        remarks=(
            *table_remarks(case),
            *mesh_remarks(case, torus, pairs),
            *subdomain_remarks(case, bodies, len(rank), triangles),
        ),
    )
    shares = cut_for_ranks(torus, subdomain, table, n_ranks, pinned_class(torus))
    return [RankShare(summary, table, pairs, own) for own in shares]


def match_distance(case: Case, width: float, height: float, centres: Float, radii: Float) -> float | None:
    """Return the match distance of fibres with these centres (n, 2) and radii (n,)."""
    window = case.cell.matched
    if window is None:
        return None
    from feti_homog.fibres.matched_arrangement import distance_of  # with statistics of neighbours

    return distance_of(window, width, height, centres, radii)


def wanted_pieces(
    case: Case,
    load: Int,
    edges: Int,
    lattice: ReferenceLattice,
    n_ranks: int,
    policy: PartitionPolicy = DEFAULT_POLICY,
) -> Int:
    """(b,) wanted pieces of each body: what the case says, else what the policy says; at least one for each rank.

    Args:
        load: (b,) coarse triangles of each body.
        edges: (b,) coarse edges that each body shares with others.
    """
    # A coarse triangle brings about M^2 / 2 nodes.
    dofs_of_triangle = lattice.intervals**2
    if case.decomposition.max_dofs is not None:
        return pieces_for_size(load, dofs_of_triangle, case.decomposition.max_dofs)
    if case.decomposition.subdomains is not None:
        return pieces_for_count(load, case.decomposition.subdomains)
    all_dofs = int(load.sum()) * dofs_of_triangle
    boundary = edges * 2 * lattice.intervals
    if case.interface is None:
        evenly_shared = min(policy.even_cut_factor * policy.piece_dofs, policy.even_share * all_dofs / n_ranks)
        largest = max(policy.cut_factor * policy.piece_dofs, evenly_shared)
        to_cut = (load * dofs_of_triangle > largest) | (boundary > policy.cut_factor * policy.piece_boundary_dofs)
    else:
        to_cut = boundary > policy.breakable_boundary_dofs
    by_size = pieces_for_size(load, dofs_of_triangle, policy.piece_dofs)
    by_boundary = np.minimum(-(-boundary // policy.piece_boundary_dofs), load)
    pieces = np.where(to_cut, np.maximum(by_size, by_boundary), 1)
    return pieces if pieces.sum() >= n_ranks else pieces_for_count(load, n_ranks)


def in_cell(points: Float, period: Float) -> Float:
    """Return the images of points (k, 2) in [0, period); those that rounding puts at its end are at 0."""
    inside = np.mod(points, period)
    return np.where(inside > (1 - ROUNDING) * period, 0.0, inside)


def _outer_edges(torus: Torus, parts: Int) -> Int:
    """(b,) coarse edges of each body that others share."""
    left, right, _ = torus.sides
    outer = parts[left] != parts[right]
    return np.bincount(np.r_[parts[left[outer]], parts[right[outer]]], minlength=int(parts.max()) + 1)
