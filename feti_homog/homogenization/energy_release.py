"""The energy release rate G = -d(energy) / d(debonded length), at constant strain, at the tips of debonded arcs.

Rigid bonds: G follows from a virtual extension of the crack.  The nodes around the tip turn about the centre of the
fibre by s q, and their displacements with them; q is 1 near the tip and falls to 0 farther away.  That moves the tip
along the interface by s R and leaves bonded nodes bonded and gaps as they are, so it is an admissible variation, and the
energy of equilibrium changes by as much as that of the elements does with the moved nodes (`fem.virtual_extension`).
Its error is that of the energy, on any mesh.  The modes share G as the work of closing the last element does (virtual
crack closure): that share depends on the length of the element where the two materials differ.

Elastic bonds: G = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t), the energy of the spring at the tip, which needs no singularity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from feti_homog.fem.virtual_extension import energy_change
from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact import BONDED, Interface, Status
from feti_homog.interface.crack_tips import CrackTips, InterfaceChains, closing_work
from feti_homog.mechanics.voigt import strain_tensor
from feti_homog.typing import Bool, Float, Int

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
# Radius around a tip beyond which nothing turns / distance to the next tip or circle; and that within which all turns
# alike / the former.
REACH, CORE = 0.8, 0.5
# And at most / a period of the cell.
REACH_OF_A_PERIOD = 0.4
# Relative distance from a circle beyond which a node of the same fibre is on another image of it.
OFF_CIRCLE = 1e-4
# Length at which the modes are told apart, at least one element / radius of the fibre.
MODE_LENGTH = 1e-3


@dataclass(frozen=True)
class EnergyRelease:
    """At t tips under one load, in the order of fibres and directions.

    Attributes:
        fibre: (t,) numbers from 1.
        direction: (t,) degrees in [0, 360) about the centre of the fibre.
        modes: (t, 2) G_I and G_II.
        length: (t,) of the element behind the tip.
    """

    fibre: Int
    direction: Float
    modes: Float
    length: Float

    @property
    def total(self) -> Float:
        """(t,) G."""
        return np.asarray(self.modes.sum(axis=1))

    @property
    def mode_angle(self) -> Float:
        """(t,) degrees psi, tan^2 psi = G_II / G_I; 0 is opening, 90 shear."""
        roots = np.sqrt(np.maximum(self.modes, 0.0))
        return np.asarray(np.degrees(np.arctan2(roots[:, 1], roots[:, 0])))


class _Patches:
    """The elements of a subdomain around the tips of cracks."""

    def __init__(self, subdomain: Subdomain, period: Float) -> None:
        mesh = subdomain.mesh
        self.subdomain, self.period = subdomain, period
        self._tree = cKDTree(_wrapped(mesh.points, period), boxsize=period)
        elements = np.repeat(np.arange(len(mesh.triangles)), mesh.triangles.shape[1])
        entries = np.ones(len(elements), np.int8), (mesh.triangles.ravel(), elements)
        self._elements_of = csr_matrix(entries, shape=(len(mesh.points), len(mesh.triangles)))

    def energy_change(self, tip: Float, spoke: Float, reach: float, u: Float, E: Float) -> float:
        """Of these elements when the crack turns by a unit angle.

        Args:
            tip, spoke: (2,) its place, and that from the centre of its circle.
            reach: beyond it nothing turns.
            u: (plane nodes, 2) u*.
            E: (2, 2) macroscopic strain.
        """
        near = self._tree.query_ball_point(_wrapped(tip, self.period), reach)
        if not near:
            return 0.0
        mesh = self.subdomain.mesh
        nodes = mesh.triangles[np.unique(self._elements_of[near].indices)]
        points = mesh.points[nodes]
        away = points - tip
        away -= np.round(away / self.period) * self.period
        # An element lies as one, at the image of its node that is nearest to the tip.
        nearest = np.argmin((away**2).sum(axis=2), axis=1)[:, None, None]
        away = points + np.take_along_axis(away - points, nearest, axis=1)
        share = np.clip((reach - np.linalg.norm(away, axis=2)) / (reach * (1 - CORE)), 0.0, 1.0)[..., None]
        total = u[nodes] + away @ E
        moved, changed = share * ((away + spoke) @ QUARTER_TURN.T), share * (total @ QUARTER_TURN.T)
        return energy_change(points, total, self.subdomain.L, moved, changed)


class TipEnergies:
    """Energy release rates of a torn cell, response by response.

    Attributes:
        interface: with whose contact the responses were found.
        points, fibre, direction, length: (n, 2) and (n,) of the interface nodes of all ranks: positions, constituents,
            degrees about the centre of the fibre, tributary lengths.
    """

    def __init__(self, cell: TornCell, interface: Interface) -> None:
        """Collective."""
        nodes, period = interface.nodes, cell.summary.period
        self.cell, self.interface = cell, interface
        neighbours = InterfaceNeighbours(cell.comm, cell.solver.jump_operator, cell.subdomains, cell.summary.phases[0])
        self._chains = InterfaceChains(neighbours.adjacency)
        self.points, self.fibre = self._gathered(nodes.points), self._gathered(nodes.fibre)
        self.direction, self.length = self._gathered(cell.directions), self._gathered(nodes.length)
        self._tree = cKDTree(_wrapped(self.points, period), boxsize=period)
        self._patches = [_Patches(s, period) for s in cell.subdomains]

    def of(self, response: Response) -> EnergyRelease:
        """G and its modes at all tips of a response.  Collective."""
        solution, status = response.state.solution, self._gathered(response.state.status)
        tips = self._tips(status)
        jump = self._gathered(self.interface.jump(solution))
        force = self._gathered(self.interface.traction(solution)) * self.length[:, None]
        jump[np.abs(jump) < self.interface.gap_noise(solution.strain)] = 0.0
        force[np.abs(force) < self.interface.force_noise(solution)] = 0.0
        closing, length = self._closing(tips, status, force, jump)
        modes = self._modes(tips, response, force, closing)
        return EnergyRelease(
            fibre=self.cell.summary.fibre_number(self.fibre[tips.node]),
            direction=self.direction[tips.node] % 360.0,
            modes=response.scale**2 * modes,
            length=length,
        )

    def _tips(self, status: Status) -> CrackTips:
        """The tips on round fibres, in the order of fibres and directions."""
        found = self._chains.tips(status)
        order = np.lexsort((self.direction[found.node] % 360.0, self.fibre[found.node]))
        return found.chosen(order[np.isfinite(self.cell.summary.radii[self.fibre[found.node[order]]])])

    def _closing(self, tips: CrackTips, status: Status, force: Float, jump: Float) -> tuple[Float, Float]:
        """(t, 2) `closing_work` in opening and in shear, and (t,) the length that is closed: MODE_LENGTH, or the element
        behind the tip if that is longer."""
        place, order = self.points[tips.node], self.cell.case.cell.order
        wanted = MODE_LENGTH * self.cell.summary.radii[self.fibre[tips.node]]
        within = self._tree.query_ball_point(_wrapped(place, self.cell.summary.period), wanted, return_length=True)
        steps = order + int(within.max(initial=1))
        work, length = np.zeros((len(place), 2)), np.zeros(len(place))
        chains = [self._chains.onward(tips.node, start, steps) for start in (tips.behind, tips.ahead)]
        for t, (behind, ahead) in enumerate(zip(*chains, strict=True)):
            behind = behind[: _leading((behind >= 0) & ((status[behind] != BONDED) | (behind == tips.node[t])))]
            ahead = ahead[: _leading((ahead >= 0) & (status[ahead] == BONDED))]
            to_behind, to_ahead = (
                np.linalg.norm(self._away(self.points[chain], place[t]), axis=1) for chain in (behind, ahead)
            )
            length[t] = max(wanted[t], to_behind[min(order, len(behind) - 1)])
            work[t] = closing_work(length[t], to_ahead, force[ahead], to_behind, jump[behind])
        return work, length

    def _modes(self, tips: CrackTips, response: Response, force: Float, closing: Float) -> Float:
        """(t, 2) G_I and G_II for forces (n, 2) and the work of closing (t, 2), of the unscaled response.  Collective."""
        bond = self.cell.case.interface
        given = () if bond is None else (bond.normal_stiffness, bond.tangential_stiffness)
        stiffness = np.array([np.inf if k is None else k for k in given])
        if np.isinf(stiffness).all():
            work = closing.sum(axis=1, keepdims=True)
            share = np.divide(closing, work, out=np.zeros_like(closing), where=work > 0)
            return share * self._released(tips, response)[:, None]
        traction = force[tips.node] / self.length[tips.node, None]
        traction[:, 0] = np.maximum(traction[:, 0], 0.0)
        return np.where(np.isinf(stiffness), closing, traction**2 / (2 * stiffness))

    def _released(self, tips: CrackTips, response: Response) -> Float:
        """(t,) -dE/da of a virtual extension of the crack at each tip.  Collective."""
        summary, change = self.cell.summary, np.zeros(len(tips.node))
        reach, spoke = self._reach(tips)
        if len(change):
            u = self.cell.solver.displacement(response.state.solution)
            E = strain_tensor(response.state.solution.strain)
            for patches, offset in zip(self._patches, self.cell.offsets, strict=False):
                own = u[offset : offset + patches.subdomain.n_dofs].reshape(-1, 2)[patches.subdomain.mesh.node_class]
                body, phase = patches.subdomain.submesh.body, patches.subdomain.submesh.phase
                for t, node in enumerate(tips.node):
                    if phase == summary.phases[0] or body == self.fibre[node]:
                        change[t] += patches.energy_change(self.points[node], spoke[t], reach[t], own, E)
        away = self.direction[tips.node] - self.direction[tips.behind]
        onward = np.sign((away + 180.0) % 360.0 - 180.0)
        return -onward * self.cell.comm.allreduce(change) / summary.radii[self.fibre[tips.node]]

    def _reach(self, tips: CrackTips) -> tuple[Float, Float]:
        """(t,) radius around each tip in which its crack may be extended: no other tip, no other circle and no image of
        its own is there; and (t, 2) from the centre of the circle to the tip."""
        summary, place, fibre = self.cell.summary, self.points[tips.node], self.fibre[tips.node]
        radius, spoke = summary.radii[fibre], self._away(place, summary.centres[fibre])
        reach = np.minimum(radius, REACH_OF_A_PERIOD * summary.period.min())
        near = self._tree.query_ball_point(_wrapped(place, summary.period), reach)
        for t, others in enumerate(near):
            away = self._away(self.points[others], place[t])
            off_circle = np.abs(np.linalg.norm(away + spoke[t], axis=1) / radius[t] - 1) > OFF_CIRCLE
            is_foreign = (self.fibre[others] != fibre[t]) | off_circle
            is_tip = np.isin(others, np.delete(tips.node, t))
            distance = np.linalg.norm(away[is_foreign | is_tip], axis=1)
            reach[t] = min(reach[t], distance.min(initial=np.inf))
        return REACH * reach, spoke

    def _away(self, points: Float, origin: Float) -> Float:
        """(k, 2) from origins to the nearest images of points."""
        offset = points - origin
        return np.asarray(offset - np.round(offset / self.cell.summary.period) * self.cell.summary.period)

    def _gathered(self, values: Float) -> Float:
        """The values of the interface nodes of all ranks.  Collective."""
        return np.concatenate(self.cell.comm.allgather(values))


def _wrapped(points: Float, period: Float) -> Float:
    """Positions (..., 2) on the torus, in [0, period)."""
    wrapped = points % period
    return np.where(wrapped >= period, 0.0, wrapped)


def _leading(which: Bool) -> int:
    """How many are true before the first that is not."""
    return int(np.argmin(np.append(which, False)))
