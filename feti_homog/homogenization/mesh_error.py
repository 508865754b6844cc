"""Estimate of how far the mesh is from the exact answer, in the energy of each pair of responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.fem.arc_error import ArcSides, arc_energy
from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float

# Subdomains of so many elements at once: few enough for the processor's cache, many enough for NumPy.
ELEMENTS_AT_ONCE = 1 << 13
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
        shares: (m, k) what each element of this rank has of the first one's diagonal, none if they are not kept.
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


def energy_errors(
    cell: TornCell, responses: Sequence[Response], contact: bool = False, keep: bool = True
) -> EnergyErrors:
    """Return the estimates of responses of one problem, a few subdomains at a time.  Collective.

    `keep` what states of the cell need later: the factors of interiors, and `shares`.
    """
    k, area = len(responses), cell.summary.area
    found, shares = np.zeros((2, k, k)), [np.zeros((0, k))]
    for members, stress in _recovered(cell, responses, keep):
        total, each = stress.difference(keep)
        found += total, arc_energy(stress, ArcSides.of(stress, [s.submesh for s in members], cell.lattice))
        shares.append(each / area)
    elements, arcs = allreduce_sum(cell.comm, found) / area
    return EnergyErrors(elements, arcs, np.concatenate(shares), contact)


def _recovered(
    cell: TornCell, responses: Sequence[Response], keep: bool
) -> Iterator[tuple[list[Subdomain], RecoveredStress]]:
    """Yield some of this rank's subdomains after the other, those of each group of one phase, and their stresses."""
    u = np.stack([response.u for response in responses], axis=1)
    loads = np.stack([response.strain for response in responses], axis=1)
    for group in _groups(cell.subdomains):
        members = [cell.subdomains[place] for place in group]
        own = np.concatenate([cell.solver.extended(place, u, loads, keep) for place in group])
        first, meshes = members[0], [s.mesh for s in members]
        own = own.reshape(-1, first.problem.components, len(responses))
        yield members, RecoveredStress.on(meshes, first.L, first.problem, own, loads, first.is_mixed)


def _groups(subdomains: Sequence[Subdomain]) -> Iterator[list[int]]:
    """Yield the places of subdomains that follow each other, of one phase, and of ELEMENTS_AT_ONCE elements at most."""
    group, elements = list[int](), 0
    for place, s in enumerate(subdomains):
        elements += len(s.mesh.triangles)
        if group and (elements > ELEMENTS_AT_ONCE or s.submesh.phase != subdomains[group[0]].submesh.phase):
            yield group
            group, elements = [], len(s.mesh.triangles)
        group.append(place)
    if group:
        yield group
