"""Compute the energy release rate G = -d(energy) / d(debonded length) at tips, at constant strain.

G follows from a virtual crack extension, with an error like the energy error on any mesh.  The nodes around the tip,
and their displacements, turn about the fibre centre by an angle s q; q is 1 near the tip and falls to 0 farther away.
The tip moves along the interface by s R (R: fibre radius), bonded nodes stay bonded, and gaps stay constant.
This is an admissible variation, and G follows from the change of the energies of elements and elastic bonds.

For rigid bonds G is split into modes in proportion to the work in opening and in shear that closes the last part of the
crack (virtual crack closure).  The split depends on the length of this part, for the stress oscillates at a tip between
two materials.  For elastic bonds the modes are the shares of <t_n>^2 / (2 k_n) and t_t^2 / (2 k_t) in the spring energy
at the tip, which is G on fine meshes.  Displacements along the fibres do not turn: their extension gives G_III alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from feti_homog.fem import assembly, shape_functions
from feti_homog.feti.decomposition import Subdomain
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.domain_partition import in_cell
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface import debonded_arcs
from feti_homog.interface.contact import BONDED, ContactProblem, Status
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Array, Float, Int

# Closed length from which the modes are determined / fibre radius; the length has at least one element.
MODE_LENGTH = 1e-3
QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
# REACH: radius of the turning nodes about a tip / distance to boundaries.  REACH_OF_A_PERIOD: largest such radius /
# cell period.  CORE: radius within which all nodes turn by the same angle / radius of the turning nodes.
REACH, REACH_OF_A_PERIOD, CORE = 0.8, 0.32, 0.5
# Relative distance from a circle beyond which a node of its two bodies lies on another boundary or periodic image.
OFF_CIRCLE = 1e-4


class CrackExtension:
    """A virtual crack extension in the elements of a subdomain around a tip."""

    def __init__(self, subdomain: Subdomain, period: Float) -> None:
        """Prepare the search for elements around points; `period` (2,) is the period of the cell."""
        mesh = subdomain.mesh
        self.subdomain, self._period = subdomain, period
        self._tree = cKDTree(in_cell(mesh.points, period), boxsize=period)
        elements = np.repeat(np.arange(len(mesh.triangles)), mesh.triangles.shape[1])
        entries = np.ones(len(elements), np.int8), (mesh.triangles.ravel(), elements)
        self._elements_of = csr_matrix(entries, shape=(len(mesh.points), len(mesh.triangles)))

    def energy_change(self, tip: Float, spoke: Float, reach: float, u: Float, load: Float) -> float:
        """Return the derivative of the subdomain energy with respect to the angle by which a crack tip turns.

        Args:
            tip, spoke: (2,) position of the tip, and position relative to the circle centre.
            reach: distance beyond which no node turns; without a node within it, the derivative is 0.
            u: (dofs,) displacements u*.
            load: loads of the problem, the strains first.
        """
        inside = self._tree.query_ball_point(in_cell(tip, self._period), reach)
        if not inside:
            return 0.0
        mesh = self.subdomain.mesh
        nodes = mesh.triangles[np.unique(self._elements_of[inside].indices)]
        points = mesh.points[nodes]
        offset = nearest_image(points - tip, self._period)
        # All nodes of an element take the image of the element's node that is nearest to the tip.
        nearest = np.argmin((offset**2).sum(axis=2), axis=1)[:, None, None]
        offset = points + np.take_along_axis(offset - points, nearest, axis=1)
        fraction = turning_fraction(offset, reach)[..., None]
        s, problem = self.subdomain, self.subdomain.problem
        strain, uniform = np.split(load[: len(s.L)], [problem.strains])
        total = u.reshape(-1, problem.components)[mesh.node_class[nodes]] + offset @ problem.gradient(strain).T
        moved = fraction * ((offset + spoke) @ QUARTER_TURN.T)
        changed = fraction * (total @ QUARTER_TURN.T if problem.turns else 0.0 * total)
        fields = shape_functions.ElementFields.of(problem, points, total[..., None], s.L, np.zeros(1), s.is_mixed)
        return float(fields.change(s.L, uniform[:, None], moved, changed[..., None]).sum()) / 2


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


class EnergyReleaseRates:
    """The energy release rates in one problem of a torn cell, response by response.

    Attributes:
        cell, interface: torn cell, and contact problem of the responses.
        points, bodies: (n, 2) positions, and outer and inner constituents, at the interface nodes of all ranks.
        pair, direction, length: (n,) interface sections, degrees about the inner constituent's centre, lengths.
        fibre, radius: (n,) fibre numbers, also within coatings, and circle radii, NaN without a circle.
    """

    def __init__(self, cell: TornCell, interface: ContactProblem) -> None:
        """Gather the interface nodes, and find the boundaries that limit a crack extension.  Collective."""
        nodes = interface.nodes
        self.cell, self.interface, self._period = cell, interface, cell.summary.shift
        self._chains = debonded_arcs.InterfaceChains(cell.neighbours.adjacency)
        self._extensions = [CrackExtension(s, self._period) for s in cell.subdomains]
        self.points, self.bodies = self._gathered(nodes.points), self._gathered(nodes.bodies)
        self.pair, inner = self._gathered(nodes.pair), self.bodies[:, 1]
        self.fibre, self.radius = cell.summary.fibre_number(inner), cell.summary.radii[inner]
        # Rounding errors must not decide the order of directions.
        direction = np.round(self._gathered(cell.directions), debonded_arcs.DIRECTION_DIGITS)
        self.direction, self.length = np.where(direction <= -180.0, 180.0, direction), self._gathered(nodes.length)
        self._tree = cKDTree(in_cell(self.points, self._period), boxsize=self._period)
        # (k, 2) body boundary nodes on all ranks, and (k,) their bodies, -1 at voids. Each body has its own nodes
        # where two bodies meet; cuts between a body's pieces are not boundaries.
        borders = [np.bincount(s.submesh.edge_class[s.submesh.triangle_edges].ravel()) == 1 for s in cell.subdomains]
        rows, points, body = [np.zeros((0, 2), np.int64)], [np.zeros((0, 2))], [np.zeros(0, np.int64)]
        for s, border in zip(cell.subdomains, borders, strict=True):
            key = s.submesh.edge_keys[border]
            rows.append(np.column_stack([key, np.full(len(key), s.submesh.body)]))
        edges, pieces = np.unique(self._gathered(np.concatenate(rows)), axis=0, return_counts=True)
        cuts = edges[pieces > 1]
        for s, border in zip(cell.subdomains, borders, strict=True):
            cut = np.isin(s.submesh.edge_keys, cuts[cuts[:, 1] == s.submesh.body, 0])
            for edge, name in ((border & ~cut & ~s.submesh.at_void, s.submesh.body), (s.submesh.at_void, -1)):
                points.append(s.mesh.points[np.unique(assembly.nodes_along(s.submesh, s.mesh, edge))])
                body.append(np.full(len(points[-1]), name))
        self._boundaries = self._gathered(np.concatenate(points)), self._gathered(np.concatenate(body))

    def of(self, response: Response) -> EnergyRelease:
        """Return the energy release rates at all tips on circular interfaces of a response.  Collective."""
        solution, status = response.state.solution, self._gathered(response.state.status)
        tips, in_plane = self._chains.tips(status), self.cell.solver.problem.turns
        # Tips on circles, in the order of fibres, interfaces and directions.
        order = np.lexsort((self.direction[tips.node], self.pair[tips.node], self.fibre[tips.node]))
        tips = tips.chosen(order[np.isfinite(self.radius[tips.node[order]])])
        jump = self._gathered(self.interface.jump(solution))
        force = self._gathered(self.interface.traction(solution)) * self.length[:, None]
        jump[np.abs(jump) < self.interface.scales.gap_noise(solution.strain)] = 0.0
        force[np.abs(force) < self._gathered(self.interface.scales.force_noise(solution))[:, None]] = 0.0
        closing, length = self._closing(tips, status, force, jump)
        components = np.arange(force.shape[1])
        compliance = self._gathered(solution.compliance[self.interface.nodes.row[:, None] + components])
        springs = compliance * force**2 / (2 * self.length[:, None])
        work = np.where(compliance[tips.node] == 0.0, closing, springs[tips.node])
        if in_plane:
            work[(compliance[tips.node, 0] > 0.0) & (force[tips.node, 0] < 0.0), 0] = 0.0  # pressed faces do not part
        released = np.maximum(0.0, self._released(tips, response, springs.sum(axis=1)))
        share = released / np.where(work.any(axis=1), work.sum(axis=1), 1.0)
        modes = np.zeros((len(tips.node), 3))
        modes[:, components if in_plane else [2]] = response.scale**2 * share[:, None] * work
        fibre, pair, direction = self.fibre[tips.node], self.pair[tips.node], self.direction[tips.node]
        return EnergyRelease(fibre=fibre, pair=pair, direction=direction, modes=modes, length=length)

    def _released(self, tips: debonded_arcs.CrackTips, response: Response, springs: Float) -> Float:
        """Return G (t,) by a virtual crack extension at each tip, for the state before scaling.  Collective.

        `springs` (n,) are the energies per length of elastic bonds at the interface nodes.
        """
        if not len(tips.node):
            return np.zeros(0)
        solution, bodies, position = response.state.solution, self.bodies[tips.node], self.points[tips.node]
        spokes = nearest_image(position - self.cell.summary.centres[bodies[:, 1]], self._period)
        # Within `reach` of a tip there is no other tip, and no boundary except the circle of the tip.
        radius, (points, body), period = np.linalg.norm(spokes, axis=1), self._boundaries, self._period
        reach, wrapped = np.minimum(radius, REACH_OF_A_PERIOD / REACH * period.min()), in_cell(position, period)
        nearest, _ = cKDTree(wrapped, boxsize=period).query(wrapped, 2)  # infinite for a single tip
        reach = np.minimum(reach, nearest[:, 1])
        inside = cKDTree(in_cell(points, period), boxsize=period).query_ball_point(wrapped, reach)
        for t, nodes in enumerate(inside):
            offset = nearest_image(points[nodes] - position[t], period)
            off_circle = np.abs(np.linalg.norm(offset + spokes[t], axis=1) / radius[t] - 1) > OFF_CIRCLE
            limits = off_circle | ~np.isin(body[nodes], bodies[t])
            reach[t] = REACH * min(reach[t], np.linalg.norm(offset[limits], axis=1).min(initial=np.inf))
        u = self.cell.solver.displacement(solution)
        ends, change = np.cumsum([s.n_dofs for s in self.cell.subdomains]), np.zeros(len(bodies))
        for extension, of_body in zip(self._extensions, np.split(u, ends[:-1]), strict=False):
            for t in np.flatnonzero((bodies == extension.subdomain.submesh.body).any(axis=1)):
                change[t] += extension.energy_change(position[t], spokes[t], reach[t], of_body, solution.strain)
        change = distributed_arrays.allreduce_sum(self.cell.comm, change)
        # Elastic bonds between nodes of different q become longer or shorter: the integral of their energy over dq.
        elastic = (self._chains.neighbours[:, 0] >= 0) & np.isfinite(self.radius) & (springs > 0.0)
        pair = self._chains.neighbours[elastic].T
        energy = springs[elastic] * self._turn(*pair) / 2
        for t, tip in enumerate(position):
            before, after = turning_fraction(nearest_image(self.points[pair] - tip, period), reach[t])
            change[t] += radius[t] * energy @ (after - before)
        return np.asarray(-self._turn(tips.behind, tips.node) * change / self.radius[tips.node])

    def _turn(self, start: Int, end: Int) -> Float:
        """Return the signs (k,) of the turns from interface nodes to others on the same circle."""
        degrees = self.direction[end] - self.direction[start]
        return np.asarray(np.sign((degrees + 180.0) % 360.0 - 180.0))

    def _closing(self, tips: debonded_arcs.CrackTips, status: Status, force: Float, jump: Float) -> tuple[Float, Float]:
        """Return the work that closes each crack, from forces and jumps (n, c), and the closed lengths (t,).

        The work is `closing_work` (t, c).  A closed length is the larger of MODE_LENGTH times the radius and the length
        of the element behind the tip.
        """
        least, order = MODE_LENGTH * self.radius[tips.node], self.cell.case.cell.order
        work, length = np.zeros((len(least), jump.shape[1])), np.zeros(len(least))
        # The largest number of chain nodes within these lengths, plus one element.
        counts = self._tree.query_ball_point(in_cell(self.points[tips.node], self._period), least, return_length=True)
        steps = order + int(counts.max(initial=1))
        chains = [self._chains.onward(tips.node, start, steps) for start in (tips.behind, tips.ahead)]
        for t, (behind, front) in enumerate(zip(*chains, strict=True)):
            debonded = (behind >= 0) & ((status[behind] != BONDED) | (behind == tips.node[t]))
            bonded = (front >= 0) & (status[front] == BONDED)
            # The first debonded nodes behind the tip, and the first bonded nodes ahead.
            behind = behind[: np.argmin(np.append(debonded, False))]
            front = front[: np.argmin(np.append(bonded, False))]
            to_behind, to_front = (
                np.linalg.norm(nearest_image(self.points[chain] - self.points[tips.node[t]], self._period), axis=1)
                for chain in (behind, front)
            )
            length[t] = max(least[t], to_behind[min(order, len(behind) - 1)])
            work[t] = debonded_arcs.closing_work(length[t], to_front, force[front], to_behind, jump[behind])
        return work, length

    def _gathered(self, values: Array) -> Array:
        """Gather rows, such as the values at interface nodes, from all ranks.  Collective."""
        return np.concatenate(self.cell.comm.allgather(values))


def nearest_image(offset: Float, period: Float) -> Float:
    """Return offsets (..., 2) shifted to their shortest periodic images."""
    return np.asarray(offset - np.round(offset / period) * period)


def turning_fraction(offset: Float, reach: float) -> Float:
    """Return the factors q (..) at offsets (.., 2) from a tip: 1 in the core, 0 beyond `reach`."""
    return np.asarray(np.clip((reach - np.linalg.norm(offset, axis=-1)) / (reach * (1 - CORE)), 0.0, 1.0))
