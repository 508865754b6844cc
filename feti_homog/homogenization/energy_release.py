"""The energy release rate G = -d(energy) / d(debonded length), at constant strain, at the tips of debonded arcs.

Of rigid bonds G follows from a virtual extension of the crack, and errs like the energy, on any mesh.  The modes share
it as the work of closing the last part of the crack does (virtual crack closure).  That share depends on the length of
this part, for between two materials the stress oscillates towards the tip.

Of elastic bonds G = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t) is the energy of the spring at the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.spatial import cKDTree

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
from feti_homog.interface.tips.debonded_arcs import CrackTips, InterfaceChains, closing_work
from feti_homog.materials.voigt import strain_tensor
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Bool, Float, Int

Array = TypeVar("Array", Float, Int, Status)

DIRECTION_DIGITS = 9
# Length at which the modes are separated, at least one element / radius of the fibre.
MODE_LENGTH = 1e-3


@dataclass(frozen=True)
class EnergyRelease:
    """At t tips under one load, in the order of fibres, interfaces and directions.

    Attributes:
        fibre: (t,) numbers from 1.
        pair: (t,) interfaces of the case.
        direction: (t,) degrees in (-180, 180] about the centre of the fibre.
        modes: (t, 2) G_I and G_II.
        length: (t,) at which rigid bonds have these modes.
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
    """Energy release rates of a torn cell, response by response.

    Attributes:
        interface: with whose contact the responses were found.
        points, bodies, pair, direction, length: (n, 2) and (n,) of the interface nodes of all ranks: positions, the
            outer and the inner constituent, interfaces of the case, degrees about the centre of the inner one,
            tributary lengths.
    """

    def __init__(self, cell: TornCell, interface: ContactProblem) -> None:
        """Find the tips and their neighbours.  Collective."""
        nodes = interface.nodes
        self.cell, self.interface, self._period = cell, interface, cell.summary.period
        self._chains = InterfaceChains(cell.neighbours.adjacency)
        self._extension = CrackExtension(cell.subdomains, self._period)
        self._boundaries = body_boundaries(cell.comm, cell.subdomains)
        self.points, self.bodies = self._gathered(nodes.points), self._gathered(nodes.bodies)
        self.pair = self._gathered(nodes.pair)
        # Rounded, lest rounding decide their order.
        direction = np.round(self._gathered(cell.directions), DIRECTION_DIGITS)
        self.direction, self.length = np.where(direction <= -180.0, 180.0, direction), self._gathered(nodes.length)
        self._tree = cKDTree(wrapped(self.points, self._period), boxsize=self._period)

    def of(self, response: Response) -> EnergyRelease:
        """G and its modes at all tips of a response.  Collective."""
        solution, status = response.state.solution, self._gathered(response.state.status)
        tips = self._tips(status)
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

    def _tips(self, status: Status) -> CrackTips:
        """Return the tips on circles, in the order of fibres, interfaces and directions."""
        found = self._chains.tips(status)
        order = np.lexsort((self.direction[found.node], self.pair[found.node], self._numbers(found)))
        return found.chosen(order[np.isfinite(self._radius(found)[order])])

    def _numbers(self, tips: CrackTips) -> Int:
        """(t,) numbers of the fibres that have them, also of those within coatings."""
        return self.cell.summary.fibre_number(self.bodies[tips.node, 1])

    def _radius(self, tips: CrackTips) -> Float:
        """(t,) of the circle of each, NaN where it is none."""
        return np.asarray(self.cell.summary.radii[self.bodies[tips.node, 1]])

    def _modes(self, tips: CrackTips, response: Response, force: Float, closing: Float) -> Float:
        """(t, 2) G_I and G_II for forces (n, 2) and the work of closing (t, 2), of scale 1.  Collective."""
        stiffness = self._stiffnesses()[self.pair[tips.node]]
        is_rigid = np.isinf(stiffness)
        traction = force[tips.node] / self.length[tips.node, None]
        # Faces that are pressed together do not part.
        traction[:, 0] = np.maximum(traction[:, 0], 0.0)
        modes = np.where(is_rigid, closing, traction**2 / (2 * stiffness))
        rigid = np.flatnonzero(is_rigid.all(axis=1))
        work = closing[rigid].sum(axis=1, keepdims=True)
        share = np.divide(closing[rigid], work, out=np.zeros_like(closing[rigid]), where=work > 0)
        modes[rigid] = share * np.maximum(0.0, self._released(tips.chosen(rigid), response))[:, None]
        return modes

    def _stiffnesses(self) -> Float:
        """(interfaces, 2) normal and tangential ones of the bonds, infinite where they are rigid."""
        given = [(each.normal_stiffness, each.tangential_stiffness) for each in self.cell.case.interfaces]
        return np.array([[np.inf if k is None else k for k in own] for own in given or [(None, None)]])

    def _released(self, tips: CrackTips, response: Response) -> Float:
        """(t,) G of a virtual extension of the crack at each tip.  Collective."""
        if not len(tips.node):
            return np.zeros(0)
        solution, bodies, place = response.state.solution, self.bodies[tips.node], self.points[tips.node]
        spokes = nearest_image(place - self.cell.summary.centres[bodies[:, 1]], self._period)
        reach = reach_of_tips(place, spokes, bodies, self._boundaries, self._period)
        u, E = self.cell.solver.displacement(solution), strain_tensor(solution.strain[:3])
        change = self._extension.energy_changes(bodies, place, spokes, reach, u, E)
        turn = self.direction[tips.node] - self.direction[tips.behind]
        outward = np.sign((turn + 180.0) % 360.0 - 180.0)
        return np.asarray(-outward * allreduce_sum(self.cell.comm, change) / self._radius(tips))

    def _steps(self, tips: CrackTips, within: Float) -> int:
        """Return how many nodes of a chain lie within distances (t,) of the tips at most, and one element more."""
        places = wrapped(self.points[tips.node], self._period)
        counts = self._tree.query_ball_point(places, within, return_length=True)
        return self.cell.case.cell.order + int(counts.max(initial=1))

    def _distance(self, nodes: Int, origin: int) -> Float:
        """(k,) distances of nodes from one of them."""
        away = nearest_image(self.points[nodes] - self.points[origin], self._period)
        return np.asarray(np.linalg.norm(away, axis=1))

    def _closing(self, tips: CrackTips, status: Status, force: Float, jump: Float) -> tuple[Float, Float]:
        """(t, 2) `closing_work` in opening and in shear, and (t,) the length that is closed.

        MODE_LENGTH, or the element behind the tip if that is longer.
        """
        wanted = MODE_LENGTH * self._radius(tips)
        work, length = np.zeros((len(wanted), 2)), np.zeros(len(wanted))
        chains = [
            self._chains.onward(tips.node, start, self._steps(tips, wanted)) for start in (tips.behind, tips.ahead)
        ]
        for t, (behind, ahead) in enumerate(zip(*chains, strict=True)):
            debonded = (behind >= 0) & ((status[behind] != BONDED) | (behind == tips.node[t]))
            behind, ahead = behind[: _leading(debonded)], ahead[: _leading((ahead >= 0) & (status[ahead] == BONDED))]
            to_behind, to_ahead = (self._distance(chain, tips.node[t]) for chain in (behind, ahead))
            length[t] = max(wanted[t], to_behind[min(self.cell.case.cell.order, len(behind) - 1)])
            work[t] = closing_work(length[t], to_ahead, force[ahead], to_behind, jump[behind])
        return work, length

    def _gathered(self, values: Array) -> Array:
        """Return the values of the interface nodes of all ranks. Collective."""
        gathered: Array = np.concatenate(self.cell.comm.allgather(values))
        return gathered


def _leading(which: Bool) -> int:
    """Return how many are true before the first that is not."""
    return int(np.argmin(np.append(which, False)))
