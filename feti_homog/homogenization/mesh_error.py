"""Estimate of how far the mesh is from the exact answer, in the energy of each pair of responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.fem.arc_error import ArcSides, arc_energy
from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float

# The two parts may cancel; what is left of both at least, `scripts/measure_mesh_error.py`.
LEAST_SHARE = 0.05
# The same of pairs of states whose faces touch at different places, for which the energy is not bilinear.
LEAST_SHARE_OF_CONTACT = 1.0


@dataclass(frozen=True)
class EnergyErrors:
    """Errors of E_i . Sigma_j, (k, k), of k responses under the strains E_i of a cell of area |UC|.

    Attributes:
        elements: 1/|UC| int ds_i : S : ds_j of recovered stresses less those of elements: the stiffness is too high.
        arcs: what the sides of elements make of arcs, of either sign.
        shares: (m, k) what each element of this rank has of the first one's diagonal.
        contact: whether states touch at different places.
    """

    elements: Float
    arcs: Float
    shares: Float
    contact: bool

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
        share = np.full((len(size),) * 2, LEAST_SHARE_OF_CONTACT if self.contact else LEAST_SHARE)
        np.fill_diagonal(share, LEAST_SHARE)
        return np.asarray(np.maximum(np.abs(self.signed), share * np.outer(size, size)))


def energy_errors(cell: TornCell, responses: Sequence[Response], contact: bool = False) -> EnergyErrors:
    """Return the estimates of responses of one problem.  Collective."""
    k, sizes = len(responses), [len(s.mesh.triangles) for s in cell.subdomains]
    found, shares = np.zeros((2, k, k)), [np.zeros((size, k)) for size in sizes]
    for members, stress in _recovered(cell, responses):
        total, each = stress.difference()
        sides = ArcSides.of(stress, [cell.subdomains[n].submesh for n in members], cell.lattice)
        found += total, arc_energy(stress, sides)
        parts = np.split(each, np.cumsum([sizes[n] for n in members])[:-1])
        for number, part in zip(members, parts, strict=True):
            shares[number] = part
    elements, arcs = allreduce_sum(cell.comm, found) / cell.summary.area
    return EnergyErrors(elements, arcs, np.concatenate([np.zeros((0, k)), *shares]) / cell.summary.area, contact)


def _recovered(cell: TornCell, responses: Sequence[Response]) -> Iterator[tuple[list[int], RecoveredStress]]:
    """Yield the numbers of this rank's subdomains of each phase, and their stresses.  Collective at first."""
    loads = np.stack([response.strain for response in responses], axis=1)
    u = np.stack([r.scale * cell.solver.displacement(r.state.solution) for r in responses], axis=1)
    phases, c = [s.submesh.phase for s in cell.subdomains], cell.solver.problem.components
    for phase in dict.fromkeys(phases):
        members = [number for number, own in enumerate(phases) if own == phase]
        own = np.concatenate([u[cell.offsets[n] : cell.offsets[n + 1]] for n in members]).reshape(-1, c, len(responses))
        first, meshes = cell.subdomains[members[0]], [cell.subdomains[n].mesh for n in members]
        yield members, RecoveredStress.on(meshes, first.L, first.problem, own, loads, first.is_mixed)
