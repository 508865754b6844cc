"""Tips of debonding in result.json: energies that drive them on, release rates, and modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from feti_homog.analysis.result_records import TipRates, Tips
from feti_homog.feti.decomposition.neighbours import InterfaceNeighbours
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.energy_release import EnergyReleaseRates
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, BondState
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.path.path_points import Point
from feti_homog.materials.voigt import STRAINS
from feti_homog.typing import Float, Int

EMPTY = np.zeros(0)
# Loads under which energy release rates are known; "strain" is a given one.
IN_PLANE_LOADS = (*STRAINS, "strain")
# Directions of nodes differ by rounding from rank to rank, and so would their order.
DIRECTION_DIGITS = 9


class TipRateRecorder:
    """Makes the records of debonded arcs in the plane problem."""

    def __init__(self, plane: Homogenization) -> None:
        self._plane = plane

    @cached_property
    def _rates(self) -> EnergyReleaseRates:
        """Collective when first used."""
        return EnergyReleaseRates(self._plane.cell, self._plane.interface)

    def of(self, responses: Sequence[Response], loads: Sequence[str]) -> TipRates:
        """Rates at all tips under each load that has them; none while all is bonded.  Collective."""
        pairs = zip(responses, loads, strict=True)
        found = [
            (self._rates.of(response), load)
            for response, load in pairs
            if load.lstrip("-") in IN_PLANE_LOADS and response.debonded
        ]
        columns = [
            (at.fibre, at.pair, at.direction, at.total, *at.modes.T, at.mode_angle, at.length) for at, _ in found
        ]
        fibre, pair, angle, G, G_I, G_II, psi, length = (
            map(np.concatenate, zip(*columns, strict=True)) if found else [EMPTY] * 8
        )
        several = len(self._plane.cell.case.interfaces) > 1
        return TipRates(
            load=tuple(load for at, load in found for _ in at.fibre),
            fibre=tuple(fibre.astype(int).tolist()),
            angle=angle,
            G=G,
            G_I=G_I,
            G_II=G_II,
            psi=psi,
            length=length,
            interface=tuple((pair + 1).astype(int).tolist()) if several else None,
        )


def bond_directions(cell: TornCell) -> Float:
    """(k,) directions in degrees, above -180, of this rank's interface nodes about the centres of their fibres.

    Of a fibre without centre those of their normals.
    """
    normal = cell.solver.jump_operator.nodes.normal
    own = np.degrees(np.arctan2(normal[:, 1], normal[:, 0]))
    direction = np.where(np.isnan(cell.directions), own, cell.directions)
    return np.asarray(direction + 360.0 * (np.round(direction, DIRECTION_DIGITS) <= -180.0))


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
    law: BondLaw, neighbours: InterfaceNeighbours, bonds: BondState, traction: Float, used: Float
) -> TipEnergies:
    """Energies of a state with tractions (k, c), of which bonds use the shares `used` (k,) of their strength.

    Such a share is sqrt(G / G_c(psi)).  Collective.
    """
    everywhere = np.concatenate(neighbours.comm.allgather(bonds.status))
    beside = (neighbours.adjacency @ (everywhere != BONDED) > 0)[neighbours.first :][: len(bonds.status)]
    is_tip = (bonds.status == BONDED) & beside
    node = np.flatnonzero(is_tip)
    energy = used[node] ** 2 * law.fracture(bonds, is_tip, traction)
    mode = law.at(node).mode_angle(traction[node])
    return TipEnergies(node, energy * np.cos(mode) ** 2, energy * np.sin(mode) ** 2, np.degrees(mode))


class TipRecorder:
    """Makes the records of points whose bonds have a toughness."""

    def __init__(self, cell: TornCell, loaded: CoupledInterfaces, law: BondLaw) -> None:
        """Prepare the records of tips; `loaded` are the interfaces of the cell.  Collective."""
        self._cell, self._loaded, self._law = cell, loaded, law
        self._neighbours = cell.neighbours

    def of(self, point: Point) -> Tips:
        """Return the tips of a point on every rank, by fibre, interface and direction. Collective."""
        cell, nodes = self._cell, self._loaded.nodes
        traction = point.scale * self._loaded.traction(point.state.solutions)
        own = tip_energies(self._law, self._neighbours, point.state.bonds, traction, point.used)
        direction = bond_directions(cell)[own.node]
        fibre = cell.summary.fibre_number(nodes.fibre[own.node])
        table = np.column_stack([fibre, direction, own.opening, own.shear, own.mode, nodes.pair[own.node]])
        table = np.concatenate(cell.comm.allgather(table))
        table = table[np.lexsort((np.round(table[:, 1], DIRECTION_DIGITS), table[:, 5], table[:, 0]))]
        fibre, angle, opening, shear, mode, pair = table.T
        sections = tuple((pair + 1).astype(int).tolist()) if len(cell.case.interfaces) > 1 else None
        return Tips(tuple(fibre.astype(int).tolist()), angle, opening, shear, mode, sections)
