"""Estimate of how far the mesh is from the exact answer, in the energy of each pair of responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from feti_homog.fem.arc_error import ArcSides, arc_energy
from feti_homog.fem.local_fits import KnownTractions
from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.boundary_forces import boundary_forces
from feti_homog.homogenization.nested_interiors import groups, locks, nested_interiors
from feti_homog.homogenization.uniform_parts import UniformPart, parts_of_phases
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.mesh.refinement import FineMesh, ReferenceLattice, joined
from feti_homog.mesh.submesh import Submesh
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.homogenization.shared_vertices import SharedVertices

Members = list[Subdomain] | list[UniformPart]
Recovered = tuple[RecoveredStress, ArcSides, Int]
Displacements = Iterator[tuple[Members, FineMesh, Float, Int]]
# Elements of one phase that are looked at together, where subdomains are across materials.
SAMPLED_AT_ONCE = 1 << 15
# What is not on a boundary.
INSIDE = -1
# Errors of elements and of arcs over those of meshes refined once and twice less, by the order of elements, all by
# `scripts/measure_mesh_error.py --factors`; in cells with a phase that locks, of quadratic ones by "true" there; and
# of the mesh refined once less with the displacements of the mesh itself at its nodes, by whether there are bubbles.
NESTED = {1: ((0.26, 0.27), (0.07, 0.066)), 2: ((1 / 15, 1 / 14), (1 / 185, 1 / 255))}
LOCKED = {1: (0.31, 0.34), 2: (0.1, 0.065)}
SAMPLED = {False: (0.066, 0.065), True: (0.052, 0.065)}
# The two parts may cancel; at least these shares of both are left, `scripts/measure_mesh_error.py`: on the diagonal; of
# two states by the order of elements; with quadratic ones beside interfaces that may part, or where few corners have
# most of it; and where faces touch at different places, for which the energy is not bilinear.
LEAST_SHARE, LEAST_OF_TWO = 0.05, {1: 0.01, 2: 0.005}
LEAST_OF_TWO_UNEVEN, LEAST_OF_TWO_TOUCHING = 0.05, 1.0


@dataclass(frozen=True)
class EnergyErrors:
    """Errors of E_i . Sigma_j, (k, k), of k responses under the strains E_i of a cell of area |UC|.

    Attributes:
        elements: 1/|UC| int ds_i : S : ds_j of recovered stresses less those of elements, and what springs have
            beyond tips: the stiffness is too high.
        arcs: what sides of elements make of arcs and of springs along them, of either sign.
        shares: (m, k) what each element of this rank has of the first one's diagonal, none if they are not kept.
        least_of_two: share of both parts, as if they did not cancel, that is left at least off the diagonal.
    """

    elements: Float
    arcs: Float
    shares: Float
    least_of_two: float = LEAST_OF_TWO[1]

    @property
    def signed(self) -> Float:
        """(k, k) computed less exact."""
        return self.elements + self.arcs

    @property
    def apart(self) -> Float:
        """(k, k) both parts as if they did not cancel."""
        return self.elements - self.arcs

    @property
    def least(self) -> Float:
        """(k, k) the share of these that is left at least."""
        return LEAST_SHARE * self.apart

    @property
    def absolute(self) -> Float:
        """(k, k) estimates of |computed - exact|."""
        size = np.sqrt(np.abs(np.diag(self.elements)) + np.abs(np.diag(self.arcs)))
        share = np.full((len(size),) * 2, self.least_of_two)
        np.fill_diagonal(share, LEAST_SHARE)
        return np.asarray(np.maximum(np.abs(self.signed), share * np.outer(size, size)))


def energy_errors(
    cell: TornCell,
    responses: Sequence[Response],
    contact: bool = False,
    keep: bool = True,
    nested: bool | None = None,
) -> EnergyErrors:
    """Return the estimates of responses of one problem, a few subdomains at a time.  Collective.

    `keep` what states of the cell need later: the factors of interiors, and `shares`.  `nested` from the mesh that is
    refined less, by default where `is_nested`.
    """
    k, area = len(responses), cell.summary.area
    nested = is_nested(cell, responses) if nested is None else nested
    lattice = cell.nested_lattice if nested else cell.lattice
    fewer = cell.lattice.halvings - lattice.halvings
    found, shares = np.zeros((2, k, k)), [np.zeros((0, k))]
    of_elements, of_arcs = factors(cell, fewer)
    for stress, sides in _recovered(cell, responses, keep, lattice):
        total, each = stress.difference(keep)
        arcs = arc_energy(stress, sides)
        found += of_elements * total, of_arcs * arcs
        shares.append(np.repeat(of_elements * each / 4**fewer, 4**fewer, axis=0))
    elements, arcs = allreduce_sum(cell.comm, found) / area
    if cell.case.interfaces and not cell.summary.across:
        from feti_homog.homogenization.spring_errors import spring_errors  # most cells have no springs

        elements, arcs = np.stack([elements, arcs]) + np.stack(spring_errors(cell, responses)) / area
    is_uneven = _has_corners(cell) or (lattice.order == 2 and bool(cell.case.interfaces))
    least = LEAST_OF_TWO_UNEVEN if is_uneven else LEAST_OF_TWO[lattice.order]
    return EnergyErrors(elements, arcs, np.concatenate(shares) / area, LEAST_OF_TWO_TOUCHING if contact else least)


def factors(cell: TornCell, fewer: int) -> tuple[float, float]:
    """Return the errors of elements and of arcs over those of the mesh with so many halvings less.  Collective."""
    order = cell.lattice.order
    if cell.summary.across and fewer:
        return SAMPLED[any(s.is_mixed for s in cell.subdomains)]
    if locks(cell.subdomains, cell.comm) and fewer:
        return LOCKED[order]
    return NESTED[order][fewer - 1] if fewer else (1.0, 1.0)


def is_nested(cell: TornCell, responses: Sequence[Response]) -> bool:
    """Return whether a mesh refined less has the error: not where errors fall more slowly, at corners and tips.

    Not of cells with fibres other than circles and ellipses or with voids that straight sides bound, nor of debonded
    arcs with quadratic elements or with tips to which the mesh is not graded: those of a given `tip_size`, and where
    bonds break.  Collective.
    """
    lattice = cell.lattice
    if not lattice.halvings or _has_corners(cell) or _has_straight_voids(cell):
        return False
    if not cell.case.interfaces:
        return lattice.order == 2  # with linear ones elements and arcs cancel too often
    graded = cell.case.cell.tip_size is None and not cell.case.section.breaks
    return (lattice.order == 1 and graded) or not any(response.debonded for response in responses)


def _has_corners(cell: TornCell) -> bool:
    """Return whether fibres may have corners: others than circles and ellipses."""
    return bool(np.isnan(cell.summary.frames[cell.summary.fibre_bodies]).any())


def _has_straight_voids(cell: TornCell) -> bool:
    """Return whether straight sides bound a void.  Collective."""
    parts = (s.submesh for s in cell.subdomains)
    own = any(bool((p.at_void[p.edge_class] & (p.turns == 0)).any()) for p in parts)
    return bool(cell.comm.allreduce(own, MPI.LOR))


def _recovered(
    cell: TornCell, responses: Sequence[Response], keep: bool, lattice: ReferenceLattice
) -> Iterator[tuple[RecoveredStress, ArcSides]]:
    """Yield the stresses of some of this rank's subdomains after the other, those of each group of one phase.

    On the mesh that the lattice makes.  Collective before the first.
    """
    u = np.stack([response.u for response in responses], axis=1)
    loads = np.stack([response.strain for response in responses], axis=1)
    if cell.summary.across and lattice.order == 2:
        displacements = _sampled(cell, u, loads, keep, lattice)
    else:
        displacements = (_whole if lattice is cell.lattice else _nested)(cell, u, loads, keep)
    found, meshes = list[Recovered](), list[tuple[list[Submesh], FineMesh]]()
    for members, mesh, own, place in displacements:
        first, submeshes = members[0], [s.submesh for s in members]
        stress = RecoveredStress.on(mesh, first.L, first.problem, own, loads, first.is_mixed)
        found.append((stress, ArcSides.of(stress, submeshes, lattice), place[:: first.problem.components]))
        meshes.append((submeshes, mesh))
    shared, fits = _across_cuts(cell, [stress for stress, _, _ in found], meshes)
    known = dict[int, KnownTractions]()
    if lattice.order == 1:
        bodies = [stress.u for stress, _, _ in found]
        forces = boundary_forces(cell, responses, bodies, loads)
        known = _known_tractions(shared, found, *forces, lattice is not cell.lattice)
    for number in range(len(found)):
        stress, sides, _ = found.pop(0)
        yield replace(stress, known=known.get(number), shared=fits.get(number)), sides


def _across_cuts(
    cell: TornCell, bodies: Sequence[RecoveredStress], meshes: Sequence[tuple[list[Submesh], FineMesh]]
) -> tuple[SharedVertices | None, dict[int, tuple[Int, Float]]]:
    """Return the vertices that pieces of one body share and, by the mesh, the fits there.  Collective."""
    pieces = cell.table.body
    if not ((len(pieces) > 1) if cell.summary.across else (np.bincount(pieces) > 1).any()):
        return None, {}
    from feti_homog.homogenization.fits_across_cuts import fits_across_cuts  # most bodies are not cut
    from feti_homog.homogenization.shared_vertices import SharedVertices

    shared = SharedVertices(cell.comm, meshes)
    return shared, fits_across_cuts(shared, bodies)


def _nested(cell: TornCell, u: Float, loads: Float, keep: bool) -> Displacements:
    """Yield subdomains, their mesh that is refined less, displacements (classes, c, k) on it, and (c classes,) places.

    The latter are those of displacements among those of all boundaries.
    """
    fresh = nested_interiors(cell.solver.interface_operators, cell.lattice, cell.nested_lattice)
    for interior in cell.nested_interiors if keep else fresh:
        found = interior.displacement(u, loads)
        place = np.full(found.shape[0] * found.shape[1], INSIDE)
        place[interior.known] = interior.place
        yield interior.members, interior.mesh, found, place


def _whole(cell: TornCell, u: Float, loads: Float, keep: bool) -> Displacements:
    """Yield the same on the mesh itself; places of parts of subdomains across materials are those of their dofs."""
    boundary, displacements = cell.solver.interface_operators, cell.displacements(u, loads, keep)
    places = [np.full(len(part.dofs), INSIDE) for part in cell.parts]
    if cell.summary.across:
        places = [first + np.arange(len(part.dofs)) for part, first in zip(cell.parts, cell.offsets, strict=False)]
    else:
        for place, dofs, first in zip(places, boundary.dofs, boundary.offsets, strict=False):
            place[dofs] = first + np.arange(len(dofs))
    for group in groups(cell.parts, cell.lattice):
        members = [cell.parts[k] for k in group]
        own = np.concatenate([next(displacements)[1] for _ in group])
        own = own.reshape(-1, members[0].problem.components, u.shape[1])
        yield members, joined([part.mesh for part in members]), own, np.concatenate([places[k] for k in group])


def _sampled(cell: TornCell, u: Float, loads: Float, keep: bool, lattice: ReferenceLattice) -> Displacements:
    """Yield the same of subdomains across materials at the nodes of a lattice of no more halvings.

    Those hold hardly less of the error than displacements in equilibrium on its mesh, and no place is known on arcs.
    """
    at, own = -1, np.zeros(0)
    for part in parts_of_phases(cell.subdomains, lattice, SAMPLED_AT_ONCE):
        if part.place != at:
            at, own = part.place, cell.solver.extended(part.place, u, loads, keep)
        yield [part], part.mesh, own.reshape(-1, part.problem.components, u.shape[1]), np.full(len(own), INSIDE)


def _known_tractions(
    shared: SharedVertices | None, found: Sequence[Recovered], force: Float, length: Float, is_nested: bool
) -> dict[int, KnownTractions]:
    """Return, by the mesh, tractions for recovered stresses to obey where two sides on arcs meet, none at voids.

    Forces over the lengths of nodes, or of sides if these are those of the forces' own mesh, so that the tractions of
    uniform stresses are exact.  Collective.
    """
    sums, of_node = list[Float](), np.append(length, 0.0)  # which is at INSIDE
    for stress, sides, place in found:
        ends = stress.node_class[stress.triangles[sides.element[:, None], sides.ends]].ravel()
        half = np.repeat(sides.points[:, -1] - sides.points[:, 0], 2, axis=0) / 2
        free = np.repeat(sides.at_void, 2)
        rows = np.column_stack([half[:, 1], -half[:, 0], np.hypot(*half.T), np.ones(len(ends)), free])
        own = np.flatnonzero(free | (of_node[place[ends]] > 0))
        sums.append(np.stack([np.bincount(ends[own], row, len(place)) for row in rows[own].T], axis=1))
    if shared is not None:
        parts = [sums[number][own] for number, own in zip(shared.meshes, shared.classes, strict=True)]
        for number, classes, whole in zip(shared.meshes, shared.classes, shared.sum(parts), strict=True):
            sums[number][classes] = whole
    by_mesh = dict[int, KnownTractions]()
    for number, ((stress, _, place), (*area, size, count, free)) in enumerate(
        zip(found, (own.T for own in sums), strict=True)
    ):
        at = np.flatnonzero((count == 2) | (free > 0))
        if len(at):
            on = force[np.maximum(place[at], 0)[:, None] + np.arange(stress.problem.components)]
            on[free[at] > 0] = 0.0
            areas = np.stack(area, axis=1)[at]
            lengths = of_node[place[at]] if is_nested else np.hypot(*areas.T)
            on /= np.where(free[at] > 0, 1.0, np.maximum(lengths, 1e-300))[:, None, None]
            by_mesh[number] = KnownTractions.at(at, areas / size[at, None], on)
    return by_mesh
