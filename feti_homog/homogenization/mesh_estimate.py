"""Estimate the mesh error in the energy of each pair of responses by recovered stresses.

With linear elements, recovered stresses meet the tractions at voids and interfaces (multipliers divided by lengths).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from feti_homog.fem import arc_error, local_fits, stress_recovery
from feti_homog.feti.decomposition import Subdomain
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.recovered_fields import with_displacements
from feti_homog.homogenization.uniform_parts import NONE, UniformPart, groups, locks, nested_interiors
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact import BONDED
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh, refinement
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.homogenization.cut_bodies import SharedVertices
    from feti_homog.homogenization.energy_release import TipZones

# Ratios of element and arc errors to the errors on coarser meshes (`scripts/measure_mesh_error.py --factors`).  NESTED:
# one and two halvings fewer, by element order.  LOCKED: cells with a phase that locks; of quadratic elements, true
# errors to estimates on the mesh itself.  SAMPLED: one halving fewer, with fine displacements at coarse nodes, by
# whether bubbles exist.
NESTED = {1: ((0.26, 0.27), (0.07, 0.066)), 2: ((1 / 15, 1 / 14), (1 / 185, 1 / 255))}
LOCKED = {1: (0.31, 0.34), 2: (4 / 3, 1.0)}
SAMPLED = {False: (0.066, 0.065), True: (0.052, 0.065)}
# Element and arc errors may cancel; at least these fractions remain (`scripts/measure_mesh_error.py`).  LEAST_SHARE:
# on the diagonal, and for two states if quadratic elements have interfaces that may part, or if few corners have most
# of the error.  LEAST_OF_TWO: for other pairs of states, by element order.
LEAST_SHARE, LEAST_OF_TWO = 0.05, {1: 0.01, 2: 0.005}


@dataclass(frozen=True)
class EnergyErrors:
    """The errors (k, k) in the energies E_i . Sigma_j of k responses.

    Attributes:
        elements: int ds_i : S : ds_j / area, with ds the recovered stresses less the element stresses, the errors at
            tips (`TipZones`), and the spring energy beyond tips; this error makes the stiffness too high.
        arcs: errors from straight or parabolic sides along arcs, and from springs along sides, of either sign.
        shares: (m, k) contributions of this rank's elements to the diagonal of `elements`, without errors at tips.
        least_of_two: least estimate of an error i != j over sqrt(a_i a_j), with a_i = |elements_ii| + |arcs_ii|.
    """

    elements: Float
    arcs: Float
    shares: Float
    least_of_two: float = LEAST_OF_TWO[1]

    @property
    def signed(self) -> Float:
        """The signed error (k, k): computed - exact."""
        return self.elements + self.arcs

    @property
    def least(self) -> Float:
        """The least sizes (k, k) of signed errors, in case `elements` and `arcs` of opposite signs cancel."""
        return LEAST_SHARE * (self.elements - self.arcs)

    @property
    def absolute(self) -> Float:
        """The estimate (k, k) of |computed - exact|, at least a fraction of the sizes of `elements` and `arcs`."""
        size = np.sqrt(np.abs(np.diag(self.elements)) + np.abs(np.diag(self.arcs)))
        fraction = np.full((len(size),) * 2, self.least_of_two)
        np.fill_diagonal(fraction, LEAST_SHARE)
        return np.asarray(np.maximum(np.abs(self.signed), fraction * np.outer(size, size)))


def energy_errors(
    cell: TornCell,
    responses: Sequence[Response],
    contact: bool = False,
    nested: bool | None = None,
    zones: TipZones | None = None,
) -> EnergyErrors:
    """Estimate the mesh errors of k responses in one problem.  Collective.

    Args:
        responses, contact: the responses, all with the same intact bonds, and whether faces touch.
        nested: whether to use the coarser mesh; by default the result of `is_nested`.
        zones: zones about the tips of debonded responses; found here by default.
    """
    k, area = len(responses), cell.summary.area
    nested = is_nested(cell, responses) if nested is None else nested
    lattice = cell.nested_lattice if nested else cell.lattice
    fewer = cell.lattice.halvings - lattice.halvings
    sums, shares = np.zeros((2, k, k)), [np.zeros((0, k))]
    of_elements, of_arcs = factors(cell, fewer)
    singular = None
    if any(response.debonded for response in responses):
        from feti_homog.homogenization import energy_release  # bonded cells have no tips

        zones = zones or energy_release.TipZones(cell)
        singular = zones.singular(responses[0])
    for stress, sides in _recovered(cell, responses, lattice):
        by_element, by_side = None, np.ones(len(sides.points))
        if zones and singular:
            by_element = zones.weights(stress.points[stress.triangles[:, :3]].mean(axis=1), *singular)
            by_side = zones.weights(sides.points[:, [0, -1]].mean(axis=1), *singular)
        energy, of_each = stress.difference(by_element)
        sums += of_elements * energy, of_arcs * arc_error.arc_energy(stress, sides, by_side)
        shares.append(np.repeat(of_elements * of_each / 4**fewer, 4**fewer, axis=0))
    elements, arcs = distributed_arrays.allreduce_sum(cell.comm, sums) / area
    if zones and singular:
        elements = elements + zones.energy_changes(*singular, responses, grows=True).sum(axis=0) / area
    if cell.case.interfaces and not cell.summary.across:
        lam = np.stack([response.solution.lam for response in responses], axis=1)
        state = responses[0].state
        beyond_tips, along_sides = cell.spring_sides.errors(state.status, state.solution.compliance, lam)
        elements, arcs = elements + beyond_tips / area, arcs + along_sides / area
    is_uneven = cell.summary.has_other_shapes or (lattice.order == 2 and bool(cell.case.interfaces))
    smallest = LEAST_SHARE if is_uneven else LEAST_OF_TWO[lattice.order]
    # If faces touch at different positions in two responses, the energy is not bilinear: nothing cancels.
    return EnergyErrors(elements, arcs, np.concatenate(shares) / area, 1.0 if contact else smallest)


def factors(cell: TornCell, fewer: int) -> tuple[float, float]:
    """Return the ratios of element and arc errors to the estimates on a mesh `fewer` halvings coarser.  Collective."""
    order = cell.lattice.order
    if cell.summary.across and fewer:
        return SAMPLED[cell.comm.allreduce(any(s.is_mixed for s in cell.subdomains), MPI.LOR)]
    if (fewer or order == 2) and locks(cell.parts, cell.comm):
        return LOCKED[order]
    return NESTED[order][fewer - 1] if fewer else (1.0, 1.0)


def is_nested(cell: TornCell, responses: Sequence[Response]) -> bool:
    """Return whether the mesh error follows from a coarser mesh.  Collective.

    Errors fall more slowly at corners and tips.  The result is false without a coarser lattice, with straight sides at
    voids, with fibres other than circles and ellipses, for linear elements without interfaces, and for quadratic
    elements with a phase that locks.  For debonded responses it is true only if elements are linear and the mesh is
    graded to tips: a generated mesh, without `tip_size`, for an analysis in which no bonds break.
    """
    lattice, case = cell.lattice, cell.case
    pieces = (s.submesh for s in cell.subdomains)
    straight = any(bool((piece.at_void[piece.edge_class] & (piece.turns == 0)).any()) for piece in pieces)
    if not lattice.halvings or cell.summary.has_other_shapes or cell.comm.allreduce(straight, MPI.LOR):
        return False
    # Between given displacements, the pressure of a piece on a coarser mesh is its change of volume times lambda.
    if lattice.order == 2 and locks(cell.parts, cell.comm):
        return False
    if not case.interfaces:
        return lattice.order == 2  # with linear elements both parts of the error cancel too often
    graded = case.cell.tip_size is None and not (case.cell.has_own_mesh or case.section.breaks)
    return (lattice.order == 1 and graded) or not any(response.debonded for response in responses)


def _recovered(
    cell: TornCell, responses: Sequence[Response], lattice: ReferenceLattice
) -> Iterator[tuple[stress_recovery.RecoveredStress, arc_error.ArcSides]]:
    """Yield the recovered stresses and arc sides by subdomain group.  Collective before the first result.

    On a coarser `lattice` each subdomain has a new equilibrium.  Subdomains across materials take the fine
    displacements at the coarse nodes instead; the estimates are hardly smaller.
    """
    u = np.stack([response.u for response in responses], axis=1)
    loads = np.stack([response.all_loads for response in responses], axis=1)
    boundary, is_nested, across = cell.solver.interface_operators, lattice is not cell.lattice, cell.summary.across
    # For groups with one phase: members, mesh, displacements (classes, c, k), and positions (c classes,) as in `Group`.
    solved = list[tuple[list[Subdomain] | list[UniformPart], FineMesh, Float, Int]]()
    if is_nested and not across:
        solved += nested_interiors(boundary, cell.lattice, lattice, u, loads)
    else:
        inside = np.stack([response.inside for response in with_displacements(cell, responses)], axis=1)
        numbered = np.arange(len(inside)) if across else boundary.local_dofs
        position = np.full(len(inside), NONE)
        position[numbered] = np.arange(len(numbered))
        for group in groups(cell.parts, lattice):
            parts, rows = [cell.parts[k] for k in group], slice(cell.offsets[group[0]], cell.offsets[group[-1] + 1])
            mesh = refinement.joined([part.mesh for part in parts])
            if is_nested:
                mesh = replace(mesh, nodes=mesh.nodes[:, lattice.within(cell.lattice)], lattice=lattice)
            shape = -1, parts[0].problem.components, len(responses)
            solved.append((parts, mesh, inside[rows].reshape(shape), position[rows]))
    groups_of_rank, meshes = list[Group](), list[tuple[list[Submesh], FineMesh]]()
    for members, mesh, displacement, position in solved:
        first, pieces = members[0], [s.submesh for s in members]
        E = loads[: len(responses[0].strain)]
        stress = stress_recovery.RecoveredStress.on(mesh, first.L, first.problem, displacement, E, first.is_mixed)
        sides = arc_error.ArcSides.of(stress, pieces, lattice)
        groups_of_rank.append(Group(stress, sides, position[:: first.problem.components]))
        meshes.append((pieces, mesh))
    shared, fits = None, dict[int, tuple[Int, Float]]()
    pieces_of_body = [len(cell.table.body)] if across else np.bincount(cell.table.body)
    if np.max(pieces_of_body) > 1:
        from feti_homog.homogenization.cut_bodies import SharedVertices, fits_across_cuts  # most bodies are not cut

        shared = SharedVertices(cell.comm, meshes)
        fits = fits_across_cuts(shared, [group.stress for group in groups_of_rank])
    tractions = dict[int, local_fits.KnownTractions]()
    if lattice.order == 1:
        tractions = boundary_tractions(cell, responses, groups_of_rank, shared, is_nested)
    for number in range(len(groups_of_rank)):
        stress, sides, _ = groups_of_rank.pop(0)  # to free its arrays after use
        yield replace(stress, known=tractions.get(number), shared=fits.get(number)), sides


class Group(NamedTuple):
    """The recovered stresses and arc sides of a subdomain group.

    `place` (classes,) are positions among displacements on all boundaries (across materials, in all parts), or NONE.
    """

    stress: stress_recovery.RecoveredStress
    sides: arc_error.ArcSides
    place: Int


def boundary_tractions(
    cell: TornCell, responses: Sequence[Response], groups: Sequence[Group], shared: SharedVertices | None, nested: bool
) -> dict[int, local_fits.KnownTractions]:
    """Return the known tractions by group number, at arcs and voids; groups without any have no entry.  Collective.

    Tractions at voids are zero.  At a node between two sides of an arc the traction is the force divided by the node
    length if the mesh is `nested`, else by the side length, so that uniform stresses give exact tractions.
    """
    forces, lengths = _forces(cell, responses, groups)
    sums, of_node = list[Float](), np.append(lengths, 0.0)  # NONE reads the last entry
    for stress, sides, position in groups:
        ends = stress.node_class[sides.nodes[:, [0, -1]]].ravel()
        half = np.repeat(sides.points[:, -1] - sides.points[:, 0], 2, axis=0) / 2
        free = np.repeat(sides.at_void, 2)
        rows = np.column_stack([half[:, 1], -half[:, 0], np.hypot(*half.T), np.ones(len(ends)), free])
        loaded = np.flatnonzero(free | (of_node[position[ends]] > 0))
        columns = [np.bincount(ends[loaded], row, len(position)) for row in rows[loaded].T]
        sums.append(np.stack(columns, axis=1).astype(float))  # bincount without sides: integers
    if shared is not None:
        parts = [sums[number][classes] for number, classes in zip(shared.meshes, shared.classes, strict=True)]
        for number, classes, total in zip(shared.meshes, shared.classes, shared.sum(parts), strict=True):
            sums[number][classes] = total
    by_group = dict[int, local_fits.KnownTractions]()
    for number, ((stress, _, position), table) in enumerate(zip(groups, sums, strict=True)):
        ends_here, void_ends = table[:, 3:].T
        selected = np.flatnonzero((ends_here == 2) | (void_ends > 0))
        if len(selected):
            areas, size, is_free = table[selected, :2], table[selected, 2], void_ends[selected] > 0
            traction = np.zeros((len(selected), stress.problem.components, forces.shape[1]))
            traction[~is_free] = forces[position[selected[~is_free], None] + np.arange(stress.problem.components)]
            length = of_node[position[selected]] if nested else np.hypot(*areas.T)
            traction /= np.where(is_free, 1.0, np.maximum(length, 1e-300))[:, None, None]
            by_group[number] = local_fits.KnownTractions.at(selected, areas / size[:, None], traction)
    return by_group


def _forces(cell: TornCell, responses: Sequence[Response], groups: Sequence[Group]) -> tuple[Float, Float]:
    """Return the interface forces on bodies and the node lengths.  Collective.

    The forces are -B^T lam (boundary dofs, k).  The lengths (boundary dofs,) are 0 where forces give no tractions: if a
    phase locks, or rigid bonds end at debonded faces.  For subdomains across materials, rows are all dofs of the parts.
    """
    k, state, nodes = len(responses), responses[0].state, cell.solver.jump_operator.nodes
    if cell.summary.across:
        jumps = cell.jumps
        BT = jumps.B.T.tocsr()
        u = np.concatenate([np.zeros((0, k)), *(group.stress.u.reshape(-1, k) for group in groups)])
        columns = zip(responses, u.T, strict=True)
        lam = np.stack([cell.across_bonds(response.solution, x)[0] for response, x in columns], axis=1)
    else:
        jumps, BT = cell.solver.jump_operator, cell.solver.interface_operators.BT
        lam = np.stack([response.solution.lam for response in responses], axis=1)
    rows = nodes.row[:, None] + np.arange(jumps.components)
    rigid = bool(((state.solution.compliance[rows] == 0.0).all(axis=1) & (state.status == BONDED)).any())
    has_tips = cell.comm.allreduce(rigid, MPI.LOR) and any(response.debonded for response in responses)
    pairs = jumps.nodes.row[:, None] + np.arange(jumps.components)
    of_bonds, weights = np.zeros(lam.shape), np.zeros((len(lam), 2))
    of_bonds[pairs] = lam[pairs]
    if not (locks(cell.parts, cell.comm) or has_tips):
        weights[pairs] = np.stack([np.ones(len(pairs)), jumps.nodes.length], axis=1)[:, None]
    # Entries of B are 1 / n where a body has n pieces at a node, each of which takes 1 / n of the force.
    squares, lengths = (BT.power(2) @ jumps.gather(weights)).T
    shares = np.sqrt(np.where(squares > 0, squares, 1.0))
    return -(BT @ jumps.gather(of_bonds)) / shares[:, None], lengths / shares**2
