"""Move the mesh at the tips of debonded arcs, for energy release rates and for mesh errors at tips.

A virtual crack extension gives G = -d(energy) / d(debonded length) at constant strain, with an error like the energy
error on any mesh.  The nodes around the tip, and their displacements, turn about the fibre centre by an angle s q; q is
1 near the tip and falls to 0 farther away.  The tip moves by s R (R: radius), bonded nodes stay bonded, and gaps stay
constant.  This is an admissible variation, and G follows from the change of the energies of elements and elastic bonds.

For rigid bonds G is split into modes in proportion to the work in opening and in shear that closes the last part of the
crack (virtual crack closure), which depends on the length of this part: the stress oscillates between two materials.
For elastic bonds the modes are the shares of <t_n>^2 / (2 k_n) and t_t^2 / (2 k_t) in the spring energy at the tip.
Displacements along the fibres do not turn: their extension gives G_III alone.

At a tip of rigid bonds the stress is singular, and its energy error is proportional to the element size there.  So the
error is the derivative of the energy with respect to the logarithm of this size, while the mesh about the tip grows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from feti_homog.fem import assembly, shape_functions
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.domain_partition import in_cell
from feti_homog.homogenization.recovered_fields import with_displacements
from feti_homog.homogenization.uniform_parts import UniformPart
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface import debonded_arcs
from feti_homog.interface.contact import BONDED, ContactProblem, Status
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Array, Float, Int, Int32

# Closed length from which the modes are determined, in fibre radii; the length has at least one element.
MODE_LENGTH = 1e-3
QUARTER_TURN, AXES = np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([1.0, 1j])
# REACH: radius of the turning nodes about a tip, relative to the distance to boundaries.  REACH_OF_A_PERIOD: largest
# such radius, in cell periods.  CORE: radius within which q = 1, relative to the radius of turning or growing nodes.
REACH, REACH_OF_A_PERIOD, CORE = 0.8, 0.32, 0.5
# Radius of the zone about a tip where the mesh grows, in element lengths; 4 and 16 give nearly the same mesh errors.
SINGULAR = 8
# Relative distance from a circle beyond which a node of its two bodies lies on another boundary or periodic image.
OFF_CIRCLE = 1e-4


@dataclass(frozen=True)
class EnergyRelease:
    """The energy release rates at t tips, ordered by fibre, interface and direction.

    Attributes:
        fibre: (t,) numbers from 1.
        pair: (t,) interface sections.
        direction: (t,) degrees in (-180, 180] about the fibre centre.
        modes: (t, 3) G_I, G_II and G_III.
        length: (t,) closed length that determines the modes of rigid bonds.
    """

    fibre: Int
    pair: Int
    direction: Float
    modes: Float
    length: Float

    @property
    def total(self) -> Float:
        """The energy release rate G (t,)."""
        return np.asarray(self.modes.sum(axis=1))

    @property
    def mode_angle(self) -> Float:
        """The mode angle psi (t,) in degrees, tan^2 psi = (G_II + G_III) / G_I; 0 is opening, 90 shear."""
        opening, shear = self.modes[:, 0], self.modes[:, 1:].sum(axis=1)
        return np.asarray(np.degrees(np.arctan2(np.sqrt(shear), np.sqrt(opening))))


class TipZones:
    """The zones about tips of arcs on circles in which mesh nodes turn or move apart, in one problem of a torn cell.

    Attributes:
        cell, chains: torn cell, and chains of interface nodes.
        points, bodies: (n, 2) positions, and outer and inner constituents, at the interface nodes of all ranks.
        spokes: (n, 2) positions relative to the centres of the inner constituents.
        pair, direction, length: (n,) interface sections, degrees about the inner constituent's centre, lengths.
        fibre, radius: (n,) fibre numbers, also within coatings, and circle radii, NaN without a circle.
    """

    def __init__(self, cell: TornCell) -> None:
        """Gather the interface nodes, and find the boundaries that limit zones.  Collective."""
        nodes = cell.solver.jump_operator.nodes
        self.cell, self.period = cell, cell.summary.shift
        self.chains = debonded_arcs.InterfaceChains(cell.neighbours.adjacency)
        # For each part of the cell, its nodes in a tree, and the (nodes, elements) matrix of elements at nodes.
        self._parts = list[tuple[cKDTree, csr_matrix]]()
        for mesh in (part.mesh for part in cell.parts):
            starts = np.arange(0, mesh.triangles.size + 1, mesh.triangles.shape[1])
            entries, shape = np.ones(mesh.triangles.size, np.int8), (len(mesh.triangles), len(mesh.points))
            elements = csr_matrix((entries, mesh.triangles.ravel(), starts), shape).T.tocsr()
            self._parts.append((cKDTree(in_cell(mesh.points, self.period), boxsize=self.period), elements))
        self.points, self.bodies = self.gathered(nodes.points), self.gathered(nodes.bodies)
        self.pair, inner = self.gathered(nodes.pair), self.bodies[:, 1]
        self.spokes = nearest_image(self.points - cell.summary.centres[inner], self.period)
        self.fibre, self.radius = cell.summary.numbers[inner], cell.summary.radii[inner]
        # Rounding errors must not decide the order of directions.
        direction = np.round(self.gathered(cell.directions), debonded_arcs.DIRECTION_DIGITS)
        self.direction, self.length = np.where(direction <= -180.0, 180.0, direction), self.gathered(nodes.length)
        # (k, 2) body boundary nodes on all ranks, and (k,) their bodies, -1 at voids. Each body has its own nodes
        # where two bodies meet; cuts between a body's pieces are not boundaries.
        borders = [np.bincount(s.submesh.edge_class[s.submesh.triangle_edges].ravel()) == 1 for s in cell.subdomains]
        rows, points, body = [np.zeros((0, 2), np.int64)], [np.zeros((0, 2))], [np.zeros(0, np.int64)]
        for s, border in zip(cell.subdomains, borders, strict=True):
            key = s.submesh.edge_keys[border]
            rows.append(np.column_stack([key, np.full(len(key), s.submesh.body)]))
        edges, pieces = np.unique(self.gathered(np.concatenate(rows)), axis=0, return_counts=True)
        cuts = edges[pieces > 1]
        for s, border in zip(cell.subdomains, borders, strict=True):
            cut = np.isin(s.submesh.edge_keys, cuts[cuts[:, 1] == s.submesh.body, 0])
            for edge, name in ((border & ~cut & ~s.submesh.at_void, s.submesh.body), (s.submesh.at_void, -1)):
                points.append(s.mesh.points[np.unique(assembly.nodes_along(s.submesh, s.mesh, edge))])
                body.append(np.full(len(points[-1]), name))
        self._boundaries = self.gathered(np.concatenate(points)), self.gathered(np.concatenate(body))

    def tips(self, response: Response) -> debonded_arcs.CrackTips:
        """Return a response's tips on circular interfaces, sorted by fibre, interface and direction.  Collective."""
        tips = self.chains.tips(self.gathered(response.state.status))
        order = np.lexsort((self.direction[tips.node], self.pair[tips.node], self.fibre[tips.node]))
        return tips.chosen(order[np.isfinite(self.radius[tips.node[order]])])

    def reach(self, tips: debonded_arcs.CrackTips) -> Float:
        """Return zone radii (t,) about tips: no other tip, and no boundary but the tip's circle, lies in a zone."""
        bodies, position, spokes = self.bodies[tips.node], self.points[tips.node], self.spokes[tips.node]
        (points, body), period = self._boundaries, self.period
        radius, wrapped = np.linalg.norm(spokes, axis=1), in_cell(position, period)
        nearest, _ = cKDTree(wrapped, boxsize=period).query(wrapped, 2)  # infinite for a single tip
        reach = np.minimum(np.minimum(radius, REACH_OF_A_PERIOD / REACH * period.min()), nearest[:, 1])
        inside = cKDTree(in_cell(points, period), boxsize=period).query_ball_point(wrapped, reach)
        for t, nodes in enumerate(inside):
            offset = nearest_image(points[nodes] - position[t], period)
            off_circle = np.abs(np.linalg.norm(offset + spokes[t], axis=1) / radius[t] - 1) > OFF_CIRCLE
            limits = off_circle | ~np.isin(body[nodes], bodies[t])
            reach[t] = REACH * min(reach[t], np.linalg.norm(offset[limits], axis=1).min(initial=np.inf))
        return np.asarray(reach)

    def singular(self, response: Response) -> tuple[debonded_arcs.CrackTips, Float]:
        """Return the tips of rigid bonds, and radii (t,) of zones a few elements wide about each tip.  Collective."""
        tips, nodes = self.tips(response), self.cell.solver.jump_operator.nodes
        rows = nodes.row[:, None] + np.arange(self.cell.solver.problem.components)
        is_rigid = self.gathered((response.state.solution.compliance[rows] == 0.0).all(axis=1))
        tips = tips.chosen(is_rigid[tips.node])
        side = nearest_image(self.points[tips.behind] - self.points[tips.node], self.period)
        length = self.cell.case.cell.order * np.linalg.norm(side, axis=1)
        return tips, np.minimum(self.reach(tips), SINGULAR * length)

    def weights(self, points: Float, tips: debonded_arcs.CrackTips, reach: Float) -> Float:
        """Return weights (e,) of element errors at `points` (e, 2), to which `energy_changes` of growing zones add.

        The weight is 1 - q - (1 + order) r dq/dr at the distance r from a tip, and so 0 in cores and 1 beyond zones.
        """
        weights, factor, centres = np.ones(len(points)), 1 + self.cell.case.cell.order, self.points[tips.node]
        tree = cKDTree(in_cell(points, self.period), boxsize=self.period)
        inside = tree.query_ball_point(in_cell(centres, self.period), reach)
        for tip, radius, elements in zip(centres, reach, inside, strict=True):
            offset = nearest_image(points[elements] - tip, self.period)
            q = turning_fraction(offset, radius)
            slope = np.where(q < 1.0, np.linalg.norm(offset, axis=1) / (radius * (1 - CORE)), 0.0)
            weights[elements] += factor * slope - q
        return weights

    def energy_changes(
        self, tips: debonded_arcs.CrackTips, reach: Float, responses: Sequence[Response], grows: bool = False
    ) -> Float:
        """Differentiate twice the energies of k responses by the turn of each tip's mesh: (t, k, k).  Collective.

        If the mesh `grows` instead, distances to the tip grow, along the circle and across.  Nodes beyond `reach` rest.
        """
        responses, k = with_displacements(self.cell, responses), len(responses)
        u = np.stack([response.inside for response in responses], axis=1)
        loads = np.stack([response.all_loads for response in responses], axis=1)[: len(responses[0].strain)]
        bodies, changes = self.bodies[tips.node], np.zeros((len(reach), k, k))
        for (tree, elements), (part, of_part) in zip(self._parts, self.cell.by_part(u), strict=True):
            for t in np.flatnonzero((bodies == part.submesh.body).any(axis=1)):
                if inside := tree.query_ball_point(in_cell(self.points[tips.node[t]], self.period), reach[t]):
                    nodes = part.mesh.triangles[np.unique(elements[inside].indices)]
                    changes[t] += self._energy_change(tips.node[t], reach[t], part, nodes, of_part, loads, grows)
        return distributed_arrays.allreduce_sum(self.cell.comm, changes)

    def _energy_change(
        self, tip: int, reach: float, part: UniformPart, nodes: Int32, u: Float, loads: Float, grows: bool
    ) -> Float:
        """Return the part (k, k) of `energy_changes` in elements with `nodes` (e, a), u* (dofs, k) and loads (v, k)."""
        problem, spoke, points = part.problem, self.spokes[tip], part.mesh.points[nodes]
        offset = nearest_image(points - self.points[tip], self.period)
        # All nodes of an element take the image of the element's node that is nearest to the tip.
        nearest = np.argmin((offset**2).sum(axis=2), axis=1)[:, None, None]
        offset = points + np.take_along_axis(offset - points, nearest, axis=1)
        q = turning_fraction(offset, reach)
        # In the complex plane about the centre, places change by the factor 1 + s i q, or 1 + s q log(place / spoke).
        place, unit = (offset + spoke) @ AXES, spoke @ AXES
        rate = q * (np.log(np.where(q > 0.0, place / unit, 1.0)) if grows else 1j)
        moved = np.stack([(rate * place).real, (rate * place).imag], axis=2)
        H = np.stack([problem.gradient(load) for load in loads[: problem.strains].T], axis=2)
        fluctuation = u.reshape(-1, problem.components, u.shape[1])[part.mesh.node_class[nodes]]
        total = fluctuation + np.einsum("ead,cdk->eack", offset, H)
        changed = rate.imag[..., None, None] * (QUARTER_TURN @ total) if problem.turns else None
        fields = shape_functions.ElementFields.of(problem, points, total, part.L, np.zeros(1), part.is_mixed)
        return fields.change(part.L, loads[problem.strains :], moved, changed)

    def release(self, response: Response, interface: ContactProblem) -> EnergyRelease:
        """Return the energy release rates at all tips of a response to the contact problem `interface`.  Collective."""
        solution, in_plane = response.solution, self.cell.solver.problem.turns
        tips, status = self.tips(response), self.gathered(response.state.status)
        jump = self.gathered(interface.jump(solution))
        force = self.gathered(interface.traction(solution)) * self.length[:, None]
        jump[np.abs(jump) < interface.scales.gap_noise(solution.strain)] = 0.0
        force[np.abs(force) < self.gathered(interface.scales.force_noise(solution))[:, None]] = 0.0
        closing, length = self._closing(tips, status, force, jump)
        components = np.arange(force.shape[1])
        compliance = self.gathered(solution.compliance[interface.nodes.row[:, None] + components])
        springs = compliance * force**2 / (2 * self.length[:, None])
        work = np.where(compliance[tips.node] == 0.0, closing, springs[tips.node])
        if in_plane:
            work[(compliance[tips.node, 0] > 0.0) & (force[tips.node, 0] < 0.0), 0] = 0.0  # pressed faces do not part
        released = np.maximum(0.0, self._released(tips, response, springs.sum(axis=1)))
        share = released / np.where(work.any(axis=1), work.sum(axis=1), 1.0)
        modes = np.zeros((len(tips.node), 3))
        modes[:, components if in_plane else [2]] = share[:, None] * work
        return EnergyRelease(self.fibre[tips.node], self.pair[tips.node], self.direction[tips.node], modes, length)

    def _released(self, tips: debonded_arcs.CrackTips, response: Response, springs: Float) -> Float:
        """Return energy release rates G (t,), by a virtual crack extension at each tip.  Collective.

        `springs` (n,) are the energies per length of elastic bonds at the interface nodes.
        """
        if not len(tips.node):
            return np.zeros(0)
        reach, radius = self.reach(tips), self.radius[tips.node]
        change = self.energy_changes(tips, reach, [response])[:, 0, 0] / 2
        # Elastic bonds between nodes of different q become longer or shorter: the integral of their energy over dq.
        elastic = (self.chains.neighbours[:, 0] >= 0) & np.isfinite(self.radius) & (springs > 0.0)
        pair = self.chains.neighbours[elastic].T
        place = self.spokes @ AXES
        energy = springs[elastic] * np.sign((place[pair[1]] / place[pair[0]]).imag) / 2
        for t, tip in enumerate(self.points[tips.node]):
            before, after = turning_fraction(nearest_image(self.points[pair] - tip, self.period), reach[t])
            change[t] += radius[t] * energy @ (after - before)
        return np.asarray(np.sign((place[tips.behind] / place[tips.node]).imag) * change / radius)

    def _closing(self, tips: debonded_arcs.CrackTips, status: Status, force: Float, jump: Float) -> tuple[Float, Float]:
        """Return the work that closes each crack, from forces and jumps (n, c), and the closed lengths (t,).

        The work is `closing_work` (t, c).  A closed length is MODE_LENGTH times the radius, but at least one element.
        """
        least, order = MODE_LENGTH * self.radius[tips.node], self.cell.case.cell.order
        work, length = np.zeros((len(least), jump.shape[1])), np.zeros(len(least))
        # The largest number of chain nodes within these lengths, plus one element.
        tree, position = cKDTree(in_cell(self.points, self.period), boxsize=self.period), self.points[tips.node]
        counts = tree.query_ball_point(in_cell(position, self.period), least, return_length=True)
        steps = order + int(counts.max(initial=1))
        chains = [self.chains.onward(tips.node, start, steps) for start in (tips.behind, tips.ahead)]
        for t, (behind, front) in enumerate(zip(*chains, strict=True)):
            debonded = (behind >= 0) & ((status[behind] != BONDED) | (behind == tips.node[t]))
            bonded = (front >= 0) & (status[front] == BONDED)
            # The first debonded nodes behind the tip, and the first bonded nodes ahead.
            behind = behind[: np.argmin(np.append(debonded, False))]
            front = front[: np.argmin(np.append(bonded, False))]
            tip = self.points[tips.node[t]]
            to_behind = np.linalg.norm(nearest_image(self.points[behind] - tip, self.period), axis=1)
            to_front = np.linalg.norm(nearest_image(self.points[front] - tip, self.period), axis=1)
            length[t] = max(least[t], to_behind[min(order, len(behind) - 1)])
            work[t] = debonded_arcs.closing_work(length[t], to_front, force[front], to_behind, jump[behind])
        return work, length

    def gathered(self, values: Array) -> Array:
        """Concatenate rows (n, ..) of all ranks, such as the values at interface nodes, by rank.  Collective."""
        return np.concatenate(self.cell.comm.allgather(values))


def nearest_image(offset: Float, period: Float) -> Float:
    """Return offsets (..., 2) shifted to their shortest periodic images."""
    return np.asarray(offset - np.round(offset / period) * period)


def turning_fraction(offset: Float, reach: float) -> Float:
    """Return the fractions q (..) of a motion at offsets (.., 2) from a tip: 1 in the core, 0 beyond `reach`."""
    return np.asarray(np.clip((reach - np.linalg.norm(offset, axis=-1)) / (reach * (1 - CORE)), 0.0, 1.0))
