"""Energy release rate G = -d(energy) / d(debonded length), at constant strain, at debonded arc tips.

For rigid bonds G follows from a virtual crack extension, and errs like the energy, on any mesh.  Its modes have
their shares in the work that closes the crack's last part (virtual crack closure).  Shares depend on the length of
this part, because between two materials the stress oscillates towards the tip.

For elastic bonds G = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t) is the spring energy at the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.crack_extension import (
    CrackExtension,
    body_boundaries,
    nearest_image,
    reach_of_tips,
    wrapped,
)
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BONDED, Status
from feti_homog.interface.debonded_arcs import CrackTips, InterfaceChains, closing_work
from feti_homog.materials.voigt import strain_tensor
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float, Int

Array = TypeVar("Array", Float, Int, Status)

DIRECTION_DIGITS = 9
# Length at which the modes are separated, at least one element / radius of the fibre.
MODE_LENGTH = 1e-3


@dataclass(frozen=True)
class EnergyRelease:
    """Energy release at t tips under one load, ordered by fibre, interface and direction.

    Attributes:
        fibre: (t,) numbers from 1.
        pair: (t,) interface sections.
        direction: (t,) degrees in (-180, 180] about the fibre centre.
        modes: (t, 2) G_I and G_II.
        length: (t,) closed length by which rigid bonds have these modes.
    """

    fibre: Int
    pair: Int
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


class EnergyReleaseRates:
    """Energy release rates in a torn cell, response by response.

    Attributes:
        interface: the responses' contact problem.
        points, bodies, pair, direction, length: (n, 2) and (n,) at all ranks' interface nodes: positions, outer
            and inner constituents, interface sections, degrees about the inner one's centre, lengths.
    """

    def __init__(self, cell: TornCell, interface: ContactProblem) -> None:
        """Find the tips and their neighbours.  Collective."""
        nodes = interface.nodes
        self.cell, self.interface, self._period = cell, interface, cell.summary.period
        self._chains = InterfaceChains(cell.neighbours.adjacency)
        self._extensions = [CrackExtension(s, self._period) for s in cell.subdomains]
        self._boundaries = body_boundaries(cell.comm, cell.subdomains)
        self.points, self.bodies = self._gathered(nodes.points), self._gathered(nodes.bodies)
        self.pair = self._gathered(nodes.pair)
        # Rounded, lest rounding decide their order.
        direction = np.round(self._gathered(cell.directions), DIRECTION_DIGITS)
        self.direction, self.length = np.where(direction <= -180.0, 180.0, direction), self._gathered(nodes.length)
        # (interfaces, 2) normal and tangential stiffnesses of the bonds, infinite where they are rigid.
        self._stiffness = np.array(phase_laws.springs(cell.case).stiffness or ((np.inf, np.inf),))
        self._tree = cKDTree(wrapped(self.points, self._period), boxsize=self._period)

    def of(self, response: Response) -> EnergyRelease:
        """Return G and its modes at all tips in a response.  Collective."""
        solution, status = response.state.solution, self._gathered(response.state.status)
        tips = self._chains.tips(status)
        # Tips on circles, in the order of fibres, interfaces and directions.
        order = np.lexsort((self.direction[tips.node], self.pair[tips.node], self._numbers(tips)))
        tips = tips.chosen(order[np.isfinite(self._radius(tips)[order])])
        jump = self._gathered(self.interface.jump(solution))
        force = self._gathered(self.interface.traction(solution)) * self.length[:, None]
        jump[np.abs(jump) < self.interface.scales.gap_noise(solution.strain)] = 0.0
        force[np.abs(force) < self._gathered(self.interface.scales.force_noise(solution))[:, None]] = 0.0
        closing, length = self._closing(tips, status, force, jump)
        modes = self._modes(tips, response, force, closing)
        return EnergyRelease(
            fibre=self._numbers(tips),
            pair=self.pair[tips.node],
            direction=self.direction[tips.node],
            modes=response.scale**2 * modes,
            length=length,
        )

    def _numbers(self, tips: CrackTips) -> Int:
        """(t,) fibre numbers for tips, also for fibres within coatings."""
        return self.cell.summary.fibre_number(self.bodies[tips.node, 1])

    def _radius(self, tips: CrackTips) -> Float:
        """(t,) circle radii at tips; NaN without a circle."""
        return np.asarray(self.cell.summary.radii[self.bodies[tips.node, 1]])

    def _modes(self, tips: CrackTips, response: Response, force: Float, closing: Float) -> Float:
        """(t, 2) G_I and G_II for forces (n, 2) and closing work (t, 2), at scale 1.  Collective."""
        stiffness = self._stiffness[self.pair[tips.node]]
        is_rigid = np.isinf(stiffness)
        traction = force[tips.node] / self.length[tips.node, None]
        traction[:, 0] = np.maximum(traction[:, 0], 0.0)  # pressed faces do not part
        modes = np.where(is_rigid, closing, traction**2 / (2 * stiffness))
        rigid = np.flatnonzero(is_rigid.all(axis=1))
        work = closing[rigid].sum(axis=1, keepdims=True)
        share = np.divide(closing[rigid], work, out=np.zeros_like(closing[rigid]), where=work > 0)
        modes[rigid] = share * np.maximum(0.0, self._released(tips.chosen(rigid), response))[:, None]
        return modes

    def _released(self, tips: CrackTips, response: Response) -> Float:
        """(t,) G from a virtual crack extension at each tip.  Collective."""
        if not len(tips.node):
            return np.zeros(0)
        solution, bodies, place = response.state.solution, self.bodies[tips.node], self.points[tips.node]
        spokes = nearest_image(place - self.cell.summary.centres[bodies[:, 1]], self._period)
        reach = reach_of_tips(place, spokes, bodies, self._boundaries, self._period)
        u, E = self.cell.solver.displacement(solution), strain_tensor(solution.strain[:3])
        change, first = np.zeros(len(bodies)), 0
        for extension in self._extensions:
            last = first + extension.subdomain.n_dofs
            for t in np.flatnonzero((bodies == extension.subdomain.submesh.body).any(axis=1)):
                change[t] += extension.energy_change(place[t], spokes[t], reach[t], u[first:last], E)
            first = last
        turn = self.direction[tips.node] - self.direction[tips.behind]
        outward = np.sign((turn + 180.0) % 360.0 - 180.0)
        return np.asarray(-outward * allreduce_sum(self.cell.comm, change) / self._radius(tips))

    def _distance(self, nodes: Int, origin: int) -> Float:
        """(k,) node distances from the node `origin`."""
        away = nearest_image(self.points[nodes] - self.points[origin], self._period)
        return np.asarray(np.linalg.norm(away, axis=1))

    def _closing(self, tips: CrackTips, status: Status, force: Float, jump: Float) -> tuple[Float, Float]:
        """(t, 2) `closing_work` in opening and in shear, and (t,) closed lengths.

        Lengths are MODE_LENGTH radii, or the element behind the tip if it is longer.
        """
        smallest, order = MODE_LENGTH * self._radius(tips), self.cell.case.cell.order
        work, length = np.zeros((len(smallest), 2)), np.zeros(len(smallest))
        # Nodes of a chain within these lengths at most, and one element more.
        counts = self._tree.query_ball_point(
            wrapped(self.points[tips.node], self._period), smallest, return_length=True
        )
        steps = order + int(counts.max(initial=1))
        chains = [self._chains.onward(tips.node, start, steps) for start in (tips.behind, tips.ahead)]
        for t, (behind, front) in enumerate(zip(*chains, strict=True)):
            debonded = (behind >= 0) & ((status[behind] != BONDED) | (behind == tips.node[t]))
            bonded = (front >= 0) & (status[front] == BONDED)
            # The first debonded nodes behind, and the first bonded ones ahead.
            behind, front = (
                chain[: np.argmin(np.append(mask, False))] for chain, mask in ((behind, debonded), (front, bonded))
            )
            to_behind, to_front = (self._distance(chain, tips.node[t]) for chain in (behind, front))
            length[t] = max(smallest[t], to_behind[min(order, len(behind) - 1)])
            work[t] = closing_work(length[t], to_front, force[front], to_behind, jump[behind])
        return work, length

    def _gathered(self, values: Array) -> Array:
        """Gather the interface node values from all ranks.  Collective."""
        gathered: Array = np.concatenate(self.cell.comm.allgather(values))
        return gathered
