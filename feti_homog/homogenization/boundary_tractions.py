"""Interface and void tractions that recovered body stresses obey: multiplier forces over lengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mpi4py import MPI

from feti_homog.fem.arc_error import ArcSides
from feti_homog.fem.local_fits import KnownTractions
from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.uniform_parts import locks
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.states import BONDED
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.homogenization.cut_bodies import SharedVertices

INSIDE = -1  # place of a class that is not on a boundary


class Group(NamedTuple):
    """Recovered stresses and arcs in a group of subdomains, with (classes,) places among boundary displacements."""

    stress: RecoveredStress
    sides: ArcSides
    place: Int


def boundary_tractions(
    cell: TornCell, responses: Sequence[Response], groups: Sequence[Group], shared: SharedVertices | None, nested: bool
) -> dict[int, KnownTractions]:
    """Return, by the group, tractions where two sides on arcs meet, and zero ones at voids.  Collective.

    Tractions are forces over node lengths; on the mesh that has the forces, which is not `nested`, over side
    lengths, so that uniform stresses give exact tractions.
    """
    forces, lengths = _forces(cell, responses, groups)
    sums, of_node = list[Float](), np.append(lengths, 0.0)  # at INSIDE
    for stress, sides, place in groups:
        ends = stress.node_class[stress.triangles[sides.element[:, None], sides.ends]].ravel()
        half = np.repeat(sides.points[:, -1] - sides.points[:, 0], 2, axis=0) / 2
        free = np.repeat(sides.at_void, 2)
        rows = np.column_stack([half[:, 1], -half[:, 0], np.hypot(*half.T), np.ones(len(ends)), free])
        loaded = np.flatnonzero(free | (of_node[place[ends]] > 0))
        sums.append(np.stack([np.bincount(ends[loaded], row, len(place)) for row in rows[loaded].T], axis=1))
    if shared is not None:
        parts = [sums[number][classes] for number, classes in zip(shared.meshes, shared.classes, strict=True)]
        for number, classes, total in zip(shared.meshes, shared.classes, shared.sum(parts), strict=True):
            sums[number][classes] = total
    by_group = dict[int, KnownTractions]()
    for number, ((stress, _, place), table) in enumerate(zip(groups, sums, strict=True)):
        at = np.flatnonzero((table[:, 3] == 2) | (table[:, 4] > 0))
        if len(at):
            areas, size, is_free = table[at, :2], table[at, 2], table[at, 4] > 0
            traction = forces[np.maximum(place[at], 0)[:, None] + np.arange(stress.problem.components)]
            traction[is_free] = 0.0
            length = of_node[place[at]] if nested else np.hypot(*areas.T)
            traction /= np.where(is_free, 1.0, np.maximum(length, 1e-300))[:, None, None]
            by_group[number] = KnownTractions.at(at, areas / size[:, None], traction)
    return by_group


def _forces(cell: TornCell, responses: Sequence[Response], groups: Sequence[Group]) -> tuple[Float, Float]:
    """(boundary dofs, k) interface forces -B^T lam on body nodes, and (boundary dofs,) lengths.

    Lengths are 0 where no tractions follow: if a phase locks, or rigid bonds end at debonded faces.  Subdomains across
    materials have all dofs in their parts instead.  Collective.
    """
    k, state, nodes = len(responses), responses[0].state, cell.solver.jump_operator.nodes
    if cell.summary.across:
        jumps = cell.jumps
        BT = jumps.B.T.tocsr()
        u = np.concatenate([np.zeros((0, k)), *(group.stress.u.reshape(-1, k) for group in groups)])
        solutions = [replace(response.state.solution, strain=response.strain) for response in responses]
        lam = np.stack([cell.across_bonds(solution, x)[0] for solution, x in zip(solutions, u.T, strict=True)], axis=1)
    else:
        jumps, BT = cell.solver.jump_operator, cell.solver.interface_operators.BT
        lam = np.stack([response.scale * response.state.solution.lam for response in responses], axis=1)
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
