"""Estimated errors by the mesh of the loads at which bonds break, from the tractions along the interfaces.

The load of a bond errs as its traction does, the force of a node over its length.  With h the distance of nodes along
the interface, d the relative change of the utilisation by a change of the traction, and e_U the relative error of the
energy,

    e^2 = a (d[h^2 t'' + f h^4 t''''] / 12)^2 + b (d[h^4 t''''] / 12)^2 + c r^2 + g e_U^2 + k (q - 1)^2.

The first is by how much a mean over the length of a node departs from the value there, for smooth tractions; the second
what is rough from node to node; r how far a parabola between the nodes rises above the largest utilisation; the fourth
what the elements in the bodies err, and how far tips are felt; the last, at tips of debonding on springs alone, how
tractions rise towards the tip, by a factor q from the next node to it.  At tips, the tractions beyond are those of the
other side.  No e is more than 1: nothing is known of such a load.

Which bond breaks first may differ on a finer mesh.  The largest utilisation u of all bonds is known up to that of any
bond with its own error, max_i u_i (1 + e_i) - u.
"""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.context import AnalysisContext
from feti_homog.case.load_section import LoadPath
from feti_homog.feti.decomposition.neighbours import InterfaceNeighbours
from feti_homog.homogenization.bonds import plane_stiffnesses
from feti_homog.interface.contact.states import BONDED, BondState
from feti_homog.interface.laws.bond_law import BondLaw, Utilisation
from feti_homog.interface.laws.released import ReleasedEnergy
from feti_homog.interface.path.path_points import Point
from feti_homog.results.path_curves import SAME_LOAD
from feti_homog.typing import Bool, Float, Int

# By the order of elements, `scripts/measure_onset_error.py`: a, b, c, g, k of nodes in cells without debonding, of
# nodes but tips in others, of tips on springs, and of tips where released energies count; and f.
WEIGHTS = {
    1: np.array([[0.9, 0.3, 1.2, 2.5, 0.0], [0.9, 0.3, 1.2, 10.0, 0.0], [6.0, 0, 0, 10.0, 0.4], [0.5, 0, 0, 1.0, 0]]),
    2: np.array([[0.06, 0.37, 0.6, 1, 0], [0.06, 0.37, 0.6, 100, 0], [0.4, 0, 0, 10, 0.25], [0.1, 0, 0, 30, 0]]),
}
OF_FOURTH = {1: 1.0, 2: 0.0}
# Largest error of a bond: others may break first if they use at least 1 / (1 + MOST) of what the first one does.
MOST = 1.0
# Share of a traction by which it is changed for a derivative.
STEP = 1e-4
NO_LIMIT = (
    "[interface]: no error of the loads at which bonds break is estimated: beside debonded faces and corners, rigid "
    "bonds have tractions without a limit as the mesh is refined"
)


class OnsetErrors:
    """Errors of the loads of the bonds of a cell."""

    def __init__(self, context: AnalysisContext, law: BondLaw) -> None:
        """Find the nodes beside each other.  Collective."""
        cell = context.cell
        self._context, self._law, self._comm = context, law, cell.comm
        neighbours = InterfaceNeighbours(cell.comm, cell.solver.jump_operator, cell.subdomains)
        nodes = cell.solver.jump_operator.nodes
        self._first, order = neighbours.first, cell.lattice.order
        self._weights, self._of_fourth = WEIGHTS[order], OF_FOURTH[order]
        self._tips_release = isinstance(law, ReleasedEnergy)
        self._normal = np.concatenate(cell.comm.allgather(nodes.normal))
        self._stencil = _stencil(neighbours)
        rigid = np.array([not all(map(math.isfinite, plane_stiffnesses(each))) for each in context.case.interfaces])
        self._is_rigid = rigid[nodes.pair]
        has_corners = bool(np.isnan(cell.summary.frames[cell.summary.fibre_bodies]).any())
        self._corners = self._is_rigid & has_corners

    @classmethod
    def of_path(cls, context: AnalysisContext, law: BondLaw, path: LoadPath) -> Self | None:
        """Return those of a path, None with friction, with increments, and if nobody asks for errors.  Collective."""
        asked = context.states.has_place and context.case.output.mesh_error
        in_proportion = path.method == "events" and not context.case.has_friction
        return cls(context, law) if asked and in_proportion else None

    def entry(self, point: Point, energy: float) -> dict[str, float | None]:
        """Return `load_mesh_error` of a point if bonds break there on the first leg; else nothing.  As `of_point`."""
        breaks = point.broke > 0 or point.softened > 0
        on_first_leg = point.load_factor * len(self._context.case.targets) <= 1.0 + SAME_LOAD
        return {"load_mesh_error": self.of_point(point, energy)} if breaks and on_first_leg else {}

    def have_limits(self, bonds: BondState) -> bool:
        """Return whether tractions have a limit as the mesh is refined; a note, if not.  Collective."""
        own = self._corners | (self._is_rigid & (bonds.status != BONDED))
        if not self._comm.allreduce(bool(own.any()), MPI.LOR):
            return True
        if NO_LIMIT not in self._context.notes:
            self._context.notes.append(NO_LIMIT)
        return False

    def of_point(self, point: Point, energy: float) -> float | None:
        """Relative error of the load at which bonds break at a point of a first leg.

        None where tractions have no limit, and beside bonds that soften, in teeth.  `energy` is the relative error of
        the energy of the state.  Collective.
        """
        damage, bonds = self._law.damage(point.state.bonds), point.state.bonds
        softens = damage is not None and bool((damage[bonds.status == BONDED] > 0.0).any())
        if self._comm.allreduce(softens, MPI.LOR) or not self.have_limits(bonds):
            return None
        cell = self._context.loads.interfaces
        traction = np.concatenate(self._comm.allgather(cell.traction(point.state.solutions)))
        utilisation = self._law.utilisation(cell, bonds)
        node = np.flatnonzero(point.used >= 1.0 / (1.0 + MOST))
        bonded = self.bonded(bonds)
        stencil = self.stencil(node, bonded)
        error = self.relative(utilisation.at(node), stencil, traction[stencil], energy, bool(bonded.all()))
        error = point.used[node] * (1.0 + error) - 1.0
        return float(self._comm.allreduce(error.max(initial=0.0), MPI.MAX))

    def bonded(self, bonds: BondState) -> Bool:
        """(n,) which nodes of all ranks have a bond.  Collective."""
        return np.asarray(np.concatenate(self._comm.allgather(bonds.status)) == BONDED)

    def stencil(self, node: Int, bonded: Bool) -> Int:
        """(p, 5) numbers among the n nodes of all ranks of nodes (p,) of this one, in the middle, and of two beside.

        Beyond the end of what is `bonded` (n,) they are those of the other side.
        """
        own = self._stencil[self._first + node].copy()
        holds = bonded[own]
        holds[:, 0] &= holds[:, 1]
        holds[:, 4] &= holds[:, 3]
        for k, mirrored in ((0, 4), (1, 3), (3, 1), (4, 0)):
            own[:, k] = np.where(holds[:, k], own[:, k], np.where(holds[:, mirrored], own[:, mirrored], own[:, 2]))
        return np.asarray(own)

    def relative(
        self,
        bonds: Utilisation,
        stencil: Int,
        traction: Float,
        energy: float | Float,
        is_whole: bool,
        ahead: Float | None = None,
    ) -> Float:
        """(p,) relative errors, at most `MOST`, of the loads of p nodes whose stencils (p, 5) have tractions (p, 5, c).

        `bonds` is the utilisation of these nodes.  The load brings a traction `ahead` (p, c), by default all of it.
        `energy` or (p,) is the relative error of the energy of the state, whose bonds all hold if it `is_whole`.
        """
        x = self._in_frame_of_middle(stencil, traction)
        t = x[:, 2]

        def change(step: Float) -> Float:
            return _relative_change(bonds, t, step)

        second = (x[:, 1] - 2.0 * t + x[:, 3]) / 12.0
        fourth = (x[:, 0] - 4.0 * x[:, 1] + 6.0 * t - 4.0 * x[:, 3] + x[:, 4]) / 12.0
        curved, rough = change(second + self._of_fourth * fourth), change(fourth)
        before, here, after = (bonds(traction[:, k].copy()) for k in (1, 2, 3))
        towards_tip = np.maximum(_ratio(here, after) - 1.0, 0.0)
        parts = np.stack([curved, rough, _rise(before, here, after), energy + np.zeros(len(t)), towards_tip])
        kind = np.where(stencil[:, 1] == stencil[:, 3], 3 if self._tips_release else 2, 0 if is_whole else 1)
        e = np.sqrt(np.einsum("pk,kp->p", self._weights[kind], parts**2))
        rate = np.ones(len(e)) if ahead is None else np.abs(change(ahead))
        return np.asarray(np.divide(e, rate, out=np.full(len(e), MOST), where=MOST * rate > e))

    def _in_frame_of_middle(self, stencil: Int, traction: Float) -> Float:
        """(p, 5, c) tractions of stencils along normal and tangent of their middle node, and along the fibres."""
        n = self._normal[stencil]
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        x = traction[..., :1] * n + traction[..., 1:2] * tangent
        frame = np.stack([n[:, 2], tangent[:, 2]], axis=2)
        return np.concatenate([x @ frame, traction[..., 2:]], axis=2)


def _stencil(neighbours: InterfaceNeighbours) -> Int:
    """(n, 5) each node, in the middle, with two on both sides; itself, or the last one, where there are fewer."""
    n, count = len(neighbours.rows), np.diff(neighbours.adjacency.indptr)
    own = np.arange(n)
    beside = np.repeat(own[:, None], 2, axis=1)
    for k in range(2):
        there = count > k
        beside[there, k] = neighbours.adjacency.indices[neighbours.adjacency.indptr[:-1][there] + k]
    ends = []
    for near in beside.T:
        left, right = beside[near].T
        ends.append(np.where(left == own, right, left))
    return np.stack([ends[0], beside[:, 0], own, beside[:, 1], ends[1]], axis=1)


def _relative_change(share: Utilisation, t: Float, step: Float) -> Float:
    """(p,) relative change of `share` at tractions t (p, c) by small steps (p, c), linear in these; 1 of no share."""
    size, length = np.linalg.norm(t, axis=1), np.linalg.norm(step, axis=1)
    scale = (STEP * size / np.where(length > 0.0, length, 1.0))[:, None]
    here, off = share(t.copy()), share(t + scale * step) - share(t - scale * step)
    return np.asarray(np.divide(off, 2.0 * scale[:, 0] * here, out=np.ones_like(off), where=here > 0.0))


def _rise(before: Float, here: Float, after: Float) -> Float:
    """(p,) how far the parabola through three values rises above the middle one, the largest, relative to it."""
    bend, slope = np.maximum(2.0 * here - before - after, 0.0), (after - before) / 2.0
    rise = np.divide(slope**2, 2.0 * bend, out=np.zeros_like(here), where=bend > 0.0)
    return np.asarray(np.divide(np.minimum(rise, bend / 8.0), here, out=np.ones_like(here), where=here > 0.0))


def _ratio(here: Float, after: Float) -> Float:
    """(p,) here / after, finite also where `after` is zero, as of pressed bonds beside one that is pulled."""
    return np.asarray(np.divide(here, after, out=np.full_like(here, 1.0 / STEP), where=after > STEP * here))
