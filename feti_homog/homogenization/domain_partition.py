"""Cut the cell on one rank: from the coarse mesh to the submeshes of each rank, with a summary of the cell."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from feti_homog.case import Case
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition import partition
from feti_homog.homogenization import cell_remarks
from feti_homog.homogenization.partition_policy import DEFAULT_POLICY, PartitionPolicy, can_be_cut_across, wanted_pieces
from feti_homog.mesh import CoarseMesh, ReferenceLattice, SubmeshesOfRank, Torus, mesh_fibres, submeshes
from feti_homog.mesh.fill import gmsh_mesher
from feti_homog.mesh.tiles import tile_filling
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Bool, Float, Int

ROUNDING = 1e-9  # rounding error of coordinates, relative to the cell or to a fibre radius


@dataclass(frozen=True)
class CellSummary:
    """Data of the whole cell, known to every rank.

    Attributes:
        width, height: periods.
        phases: material phase names, the matrix first.
        bodies, subdomains, coarse_triangles: numbers of bodies, subdomains and coarse triangles.
        interface_edge: longest coarse edge between phases.
        numbers: (constituents,) fibre number from 1, as in case files; a coating has its fibre's number, the matrix 0.
        shift: (2,) distance between periodic images, `CoarseMesh.shift`.
        is_fibre: (constituents,) whether a constituent is a fibre, not the matrix or a coating.
        constituent_phase: (constituents,) index of the phase in `phases`.
        centres, radii: (constituents, 2) and (constituents,) centres in the cell and radii of fibres, else NaN.
        frames: (constituents, 2, 2) as in `Ellipses`, for fibres that are circles or ellipses; else NaN.
        snapped: largest distance by which a node in a user's mesh was moved to make opposite sides match.
        origin: lower left corner of the cell in the user's coordinates; all other positions are relative to the corner.
        corner_edges: most edges between phases, or beside voids, that meet at a corner; 0 without corners.
        voids, moved_tips: number of voids; for each interface, the tips that the mesher moved.
        remarks: lines about unexpected cell properties.
        across: whether subdomains reach across materials.
        interface_nodes: number of interface nodes, which have no multipliers; None unless `across`.
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
    moved_tips: tuple[Mapping[tuple[int, float], float], ...]
    snapped: float
    origin: tuple[float, float]
    voids: int
    remarks: tuple[str, ...]
    shift: Float
    corner_edges: int = 0
    across: bool = False
    interface_nodes: int | None = None

    @property
    def is_cut(self) -> bool:
        """Whether a body or, if subdomains reach across materials, the cell has several subdomains."""
        return self.subdomains > (1 if self.across else self.bodies)

    @property
    def fibres(self) -> int:
        """The number of fibres."""
        return int(self.is_fibre.sum())

    @property
    def fibre_bodies(self) -> Int:
        """The constituent index (fibres,) of each fibre, ordered by fibre number."""
        return np.flatnonzero(self.is_fibre)

    @property
    def coatings(self) -> Float:
        """The coating thicknesses (fibres,), 0 without a coating, NaN if a thickness varies."""
        return mesh_fibres.coating_thickness(self.numbers, self.is_fibre, Ellipses(self.centres, self.frames).semi_axes)

    @property
    def has_other_shapes(self) -> bool:
        """Whether fibres have shapes other than circles and ellipses."""
        return bool(np.isnan(self.frames[self.fibre_bodies]).any())

    def warnings(self) -> list[str]:
        """List a warning if a user's mesh was moved by more than rounding errors."""
        moved = f"nodes on the sides of the mesh were moved by up to {self.snapped:.3g} to match"
        return [moved] if self.snapped > 64 * np.finfo(float).eps * (self.width + self.height) else []

    @property
    def area(self) -> float:
        """The cell area |UC|."""
        return self.width * self.height


@dataclass(frozen=True)
class RankShare:
    """The part of the cut cell on one rank.

    Attributes:
        summary, table: data of the whole cell and of its subdomains.
        submeshes: the rank's submeshes.
    """

    summary: CellSummary
    table: submeshes.SubdomainTable
    submeshes: SubmeshesOfRank


def distribute(
    case: Case, mesh: CoarseMesh, lattice: ReferenceLattice, n_ranks: int, policy: PartitionPolicy = DEFAULT_POLICY
) -> list[RankShare]:
    """Cut the cell on one rank, and return the part of each rank.

    Raises CaseError on interface faults, or if an arc lies on a fibre that cannot have arcs, or selects no node.
    """
    torus, halves = Torus.of(mesh), mesh.triangles.shape[1] - 2  # a pixel is two triangles
    numbers, is_fibre = mesh_fibres.fibre_numbers(torus)
    circles, pairs = mesh_fibres.fibre_circles(torus), cell_remarks.pairs_of(case, mesh.phases)
    centres = in_cell(circles[:, :2], mesh.period) if mesh.boundary == "periodic" else circles[:, :2]
    faults = cell_remarks.faults(case, mesh.phases, *(mesh.phase[side] for side in torus.sides[:2]))
    moved: tuple[Mapping[tuple[int, float], float], ...] = ({},) * len(case.interfaces)
    if case.arcs:
        from feti_homog.homogenization import arc_selection  # other cells have no tips

        nodes = arc_selection.EstimatedNodes.of(torus, lattice, pairs, numbers, centres)
        moved, faults = arc_selection.checked(case, nodes, centres[is_fibre], faults)
    if faults:
        raise CaseError(*faults)
    parts = torus.constituent if case.cell.bodies == "torus" else torus.plane_parts()
    bodies = int(parts.max()) + 1
    cut = _cut_across(case, torus, bodies, lattice, n_ranks, policy)
    across = cut is not None
    if cut is None:
        sides = parts[np.stack(torus.sides[:2])]
        edges = np.bincount(sides[:, sides[0] != sides[1]].ravel(), minlength=bodies)
        pieces = wanted_pieces(case, halves * np.bincount(parts), edges, lattice, n_ranks, policy)
        cut = partition.decompose(torus, parts, np.minimum(pieces, np.bincount(parts)), n_ranks)
    table, pinned = submeshes.SubdomainTable.of(torus, cut.subdomain, cut.rank, across), submeshes.pinned_classes(torus)
    radii, text = circles[is_fibre, 2], cell_remarks.subdomain_remarks(case, bodies, len(cut.rank), halves * len(parts))
    bonds = _interface_nodes(torus, pairs, lattice, pinned) if across or len(case.interfaces) else 0
    summary = CellSummary(
        width=mesh.width,
        height=mesh.height,
        phases=mesh.phases,
        bodies=bodies,
        subdomains=len(cut.rank),
        coarse_triangles=halves * len(parts),
        interface_edge=float(torus.edge_lengths[torus.is_outline].max(initial=0.0)),
        numbers=numbers,
        is_fibre=is_fibre,
        constituent_phase=torus.constituent_phase,
        centres=centres,
        radii=circles[:, 2],
        frames=mesh_fibres.fibre_frames(torus),
        moved_tips=tuple(map(dict, moved)),
        snapped=mesh.snapped,
        origin=mesh.origin,
        voids=torus.voids,
        remarks=(*cell_remarks.case_remarks(case, bonds), *cell_remarks.mesh_remarks(case, torus, pairs, radii), *text),
        shift=mesh.shift,
        corner_edges=mesh_fibres.corner_edges(torus),
        across=across,
        interface_nodes=bonds if across else None,
    )
    shares = submeshes.cut_for_ranks(torus, cut.subdomain, table, n_ranks, pinned)
    return [RankShare(summary, table, part) for part in shares]


def summary_of(case: Case, noded: gmsh_mesher.NodedCell, subdomains: int, triangles: int) -> CellSummary:
    """Summarize the tiled cell `noded`, with its numbers of subdomains and coarse `triangles`."""
    regions, lines, arrangement = noded.regions, noded.lines, noded.arrangement
    inside = regions.constituent[:-1]  # without the matrix
    solid = np.flatnonzero(inside >= 0)
    circle = solid[np.unique(inside[solid], return_index=True)[1]]
    disc, radii = lines.disc[circle], regions.ellipses.circles[circle, 2]
    is_fibre = arrangement.precedence(disc, lines.is_coating[circle]) == disc + 1
    centres = in_cell(noded.scale * arrangement.centres[disc], np.array([regions.width, regions.height]))
    edges, around = tile_filling.arc_edges(lines.curves)
    ends = noded.scale * lines.points[edges]
    nothing = np.full((1, 2), np.nan)
    return CellSummary(
        width=regions.width,
        height=regions.height,
        phases=regions.phases,
        bodies=len(regions.phase),
        subdomains=subdomains,
        coarse_triangles=triangles,
        interface_edge=float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0)),
        numbers=np.append(0, disc + 1),
        is_fibre=np.append(False, is_fibre),
        constituent_phase=regions.phase,
        centres=np.concatenate([nothing, centres]),
        radii=np.append(np.nan, radii),
        frames=np.concatenate([np.full((1, 2, 2), np.nan), regions.ellipses.frames[circle]]),
        moved_tips=({},) * len(case.interfaces),
        snapped=0.0,
        origin=arrangement.origin,
        voids=arrangement.voids,
        remarks=(
            *arrangement.remarks,
            *cell_remarks.cut_off(case, regions.ellipses[around], ends),
            *cell_remarks.soft_springs(case, radii[is_fibre]),
            *cell_remarks.case_remarks(case),
            *cell_remarks.subdomain_remarks(case, len(regions.phase), subdomains, triangles),
        ),
        shift=np.array([regions.width, regions.height]),
    )


def _cut_across(
    case: Case, torus: Torus, bodies: int, lattice: ReferenceLattice, n_ranks: int, policy: PartitionPolicy
) -> partition.Partition | None:
    """Cut the cell across materials; None if the case or the policy does not allow it, or METIS leaves ranks empty."""
    elements, corners = torus.mesh.triangles.shape
    dofs, is_image = elements * (corners - 2) * lattice.intervals**2, corners == 4
    pieces = policy.across_pieces(dofs, bodies, n_ranks, is_image) if can_be_cut_across(case) else 0
    if not 0 < pieces <= elements:
        return None
    if pieces == n_ranks == 2 and dofs >= policy.strip_dofs and (strips := partition.halves(torus)):
        return strips
    parts, counts = np.zeros(elements, np.int64), np.array([pieces])
    if is_image and pieces > n_ranks:
        parts, counts = partition.blocks(torus.mesh, pieces)
    cut = partition.decompose(torus, parts, counts, n_ranks)
    return cut if len(cut.rank) >= n_ranks else None  # METIS leaves some pieces empty


def match_distance(case: Case, cell: CellSummary) -> float | None:
    """Return the error of neighbour distances of the fibres against the matched table; None without a table."""
    if (window := case.cell.matched) is None:
        return None
    from feti_homog.microstructure import fibre_pattern, random_fibres  # imports the statistics of neighbours

    centres, radii = cell.centres[cell.is_fibre], cell.radii[cell.is_fibre]
    pattern = fibre_pattern.FibrePattern(cell.width, cell.height, centres, radii, periodic=True)
    return random_fibres.match_distance(pattern, random_fibres.wanted_distances(window, pattern.count))


def in_cell(points: Float, period: Float) -> Float:
    """Shift points (k, 2) by periods into [0, period); points close to the period move to 0."""
    inside = np.mod(points, period)
    return np.where(inside > (1 - ROUNDING) * period, 0.0, inside)


def _interface_nodes(torus: Torus, pairs: Int, lattice: ReferenceLattice, pinned: Int) -> int:
    """Count the nodes where two bodies could part along an interface, without `pinned` node classes."""
    first, second, edge = torus.sides
    between = edge[pairs[torus.mesh.phase[first], torus.mesh.phase[second]] >= 0]
    ends = np.unique(torus.edge_ends[between])
    may_part = ~torus.never_part[ends] & ~np.isin(torus.class_keys[ends], pinned)
    return len(between) * (lattice.intervals - 1) + int(may_part.sum())
