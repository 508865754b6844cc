"""Energies at the tips of debonding: what drives it on, and in which mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.interface.contact.contact_problem import BONDED, Status
from feti_homog.interface.laws.energy_criterion import EnergyCriterion
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class TipEnergies:
    """The tips on this rank: bonds that hold beside broken ones.

    Attributes:
        node: (t,) numbers of their interface nodes on this rank.
        opening, shear: (t,) G_I and G_II, energies per area whose sum is compared with G_c(psi): of the bond's spring,
            or what its break would release; parted by tan^2 psi = G_II / G_I.
        mode: (t,) psi in degrees, of the traction.
    """

    node: Int
    opening: Float
    shear: Float
    mode: Float


def tip_energies(
    springs: EnergyCriterion, neighbours: InterfaceNeighbours, status: Status, traction: Float, used: Float
) -> TipEnergies:
    """Those of a state with tractions (k, 2), of which bonds use the shares `used` (k,) of their strength.

    Such a share is sqrt(G / G_c(psi)).  Collective.
    """
    everywhere = np.concatenate(neighbours.comm.allgather(status))
    beside = (neighbours.adjacency @ (everywhere != BONDED) > 0)[neighbours.first :][: len(status)]
    node = np.flatnonzero((status == BONDED) & beside)
    own = springs.at(node)
    energy = used[node] ** 2 * own.fracture_toughness(traction[node])
    mode = own.mode_angle(traction[node])
    return TipEnergies(node, energy * np.cos(mode) ** 2, energy * np.sin(mode) ** 2, np.degrees(mode))
