"""Estimate the energy errors of nodal springs, which add to the element and arc errors."""

from collections.abc import Sequence

import numpy as np
from scipy.special import roots_legendre

from feti_homog.feti.decomposition import JumpOperator, interface_neighbours, shared_entities
from feti_homog.homogenization.cut_bodies import border_lines
from feti_homog.homogenization.uniform_parts import UniformPart
from feti_homog.interface import debonded_arcs
from feti_homog.interface.contact import BONDED, Status
from feti_homog.mesh import ReferenceLattice
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float

# Gauss points of a side: exact or nearly exact for products of quadratic functions along ellipses.
POINTS, WEIGHTS = roots_legendre(6)


class SpringSides:
    """The element sides along springs on this rank, and interface nodes of all ranks, for errors of spring energy."""

    def __init__(
        self,
        jumps: JumpOperator,
        neighbours: interface_neighbours.InterfaceNeighbours,
        parts: Sequence[UniformPart],
        lattice: ReferenceLattice,
        period: Float,
    ) -> None:
        """Find the element sides of fibres in `parts`; `period` (2,) is the period of the cell.  Collective."""
        self._comm, self._jumps, self._order, self._period = neighbours.comm, jumps, lattice.order, period
        self._chains = debonded_arcs.InterfaceChains(neighbours.adjacency)
        rows = jumps.nodes.bodies[:, 1], jumps.nodes.points, jumps.nodes.normal
        fibre, self._points, self._normal = (np.concatenate(a) for a in zip(*self._comm.allgather(rows), strict=True))
        fibre = np.append(fibre, -1)  # a class that is no interface node has the number -1
        number, first = neighbours.node_numbers(jumps), 0
        # The nodes (order + 1,) of each side, the normals (q, 2) at Gauss points, whose length is the arc length per
        # unit of the arc parameter, and the turn.
        starts = np.arange(0, lattice.intervals, lattice.order)
        sides = [(np.zeros((0, lattice.order + 1), np.int64), np.zeros((0, len(POINTS), 2)), np.zeros(0))]
        for part in parts:
            triangle, k, line = border_lines(part.submesh, part.mesh, part.mesh.node_class[part.mesh.nodes])
            nodes = number[first : first + part.mesh.n_classes][line]
            first += part.mesh.n_classes
            inner = (fibre[nodes] == part.submesh.constituent[triangle, None]).all(axis=1)
            inner[inner] = (neighbours.near[nodes[inner, 0]] == nodes[inner, 1, None]).any(axis=1)  # not along a cut
            normal, turn = shared_entities.edge_normals(part.submesh, triangle[inner], k[inner])
            nodes = nodes[inner][:, starts[:, None] + np.arange(lattice.order + 1)].reshape(-1, lattice.order + 1)
            side = np.tile(np.arange(len(starts)), len(turn))
            normal, turn = np.repeat(normal, len(starts), axis=0), np.repeat(turn, len(starts))
            positions = (side[:, None] + (1 + POINTS) / 2) * lattice.order / lattice.intervals
            normal = np.stack([shared_entities.along(normal, turn, position) for position in positions.T], axis=1)
            sides.append((nodes, normal, turn))
        self._nodes, normal, turn = (np.concatenate(table) for table in zip(*sides, strict=True))
        speed = np.hypot(*np.moveaxis(normal, 2, 0))
        unit = normal / speed[:, :, None]
        # (f, q, 2, 2) normals and tangents.
        self._frame = np.stack([unit, np.stack([-unit[..., 1], unit[..., 0]], axis=2)], axis=2)
        self._ds = ds = speed * WEIGHTS / 2 * lattice.order / lattice.intervals
        length = ds.sum(axis=1)
        # Functions of linear elements are linear along the chord, and nearly linear in length along the arc.
        xi = np.broadcast_to((1 + POINTS) / 2, ds.shape)
        if lattice.order == 1:
            bend = 3 * (ds @ POINTS) / length
            xi = xi - bend[:, None] * xi * (1 - xi)
            self._shape = np.stack([1 - xi, xi])
            self._weights = np.repeat(length[:, None] / 2, 2, axis=1)
        else:
            self._shape = np.stack([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)])
            self._weights = np.einsum("fq,afq->fa", ds, self._shape)
        self._share = np.where(turn > 0, length, 0.0) / {1: 12, 2: 60}[lattice.order]

    def errors(self, status: Status, compliance: Float, lam: Float) -> tuple[Float, Float]:
        """Return two errors (k, k) of spring energy: beyond tips; along sides, to add to `arc_energy`.  Collective.

        Args:
            status: (n,) states at this rank's interface nodes.
            compliance, lam: (rows,) and (rows, k) compliances and multipliers for k responses.
        """
        nodes = self._jumps.nodes
        rows = nodes.row[:, None] + np.arange(self._jumps.components)
        force, C = lam[rows], compliance[rows]
        # A node is on springs where springs bond all directions.
        holds = (status == BONDED) & (C > 0).all(axis=1)
        stiffness = 1 / (np.where(holds[:, None], C, 1.0) * nodes.length[:, None])
        state = status, holds, stiffness, force, force * C[:, :, None]
        status, holds, stiffness, force, jump = map(np.concatenate, zip(*self._comm.allgather(state), strict=True))
        # The energy counts springs on the whole length of a tip node, but on the debonded side there are none.
        tips = self._chains.tips(status)
        ends = self._points[np.stack([tips.behind, tips.ahead])] - self._points[tips.node]
        behind, front = np.linalg.norm(ends - np.round(ends / self._period) * self._period, axis=2)
        beyond = np.einsum("t,tci,tcj->ij", behind / (behind + front), force[tips.node], jump[tips.node])
        # The nodal spring energy, less the spring energy of the interpolated jump along this rank's sides, less the
        # interpolation error on arcs.  This error enters twice: in the spring energy of the exact jump, and in the work
        # of the traction on the difference between the exact and the interpolated jump.
        side = np.flatnonzero(holds[self._nodes].all(axis=1))
        node, ds, shape = self._nodes[side], self._ds[side], self._shape[:, side]
        k, moved = stiffness[node], self._in_space(jump)[node]
        traction = self._in_space(stiffness[:, :, None] * jump)[node]
        blended, framed = (np.einsum("afq,fadi->fqdi", shape, values) for values in (moved, jump[node]))
        if moved.shape[2] == 2:
            blended = np.einsum("fqcd,fqdi->fqci", self._frame[side], blended)
        lumped = np.einsum("fa,fac,faci,facj->ij", self._weights[side], k, jump[node], jump[node], optimize=True)
        between = np.einsum("afq,fac->fqc", shape, k)
        # Slip that turns with the normal opens or closes stiff springs between nodes only if interpolated in space.
        of_space, of_turns = (
            np.einsum("fq,fqc,fqci,fqcj->ij", ds, between, values, values, optimize=True)
            for values in (blended, framed - blended)
        )
        differences = (np.diff(values, n=self._order, axis=1)[:, 0] for values in (traction, moved))
        on_arcs = np.einsum("f,fdi,fdj->ij", self._share[side], *differences, optimize=True)
        return np.asarray(beyond), distributed_arrays.allreduce_sum(
            self._comm, lumped - of_space + of_turns - on_arcs - on_arcs.T
        )

    def _in_space(self, components: Float) -> Float:
        """Rotate normal and tangential components to plane vectors (n, 2, k); keep axial components (n, 1, k)."""
        if components.shape[1] == 1:
            return components
        normal, tangent = self._normal, self._normal[:, ::-1] * [-1.0, 1.0]
        return np.asarray(normal[..., None] * components[:, None, 0] + tangent[..., None] * components[:, None, 1])
