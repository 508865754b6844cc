"""What result.json says of the tips of debonding."""

from __future__ import annotations

import numpy as np

from feti_homog.analysis.result_records import Tips
from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.laws.energy_criterion import EnergyCriterion
from feti_homog.interface.laws.tip_energies import tip_energies
from feti_homog.interface.path.path_points import Point
from feti_homog.typing import Float

# Directions of nodes differ by rounding from rank to rank, and so would their order.
DIRECTION_DIGITS = 9


def bond_directions(cell: TornCell) -> Float:
    """(k,) directions in degrees, above -180, of this rank's interface nodes about the centres of their fibres; of a
    fibre without centre those of their normals."""
    normal = cell.solver.jump_operator.nodes.normal
    own = np.degrees(np.arctan2(normal[:, 1], normal[:, 0]))
    direction = np.where(np.isnan(cell.directions), own, cell.directions)
    return np.asarray(direction + 360.0 * (np.round(direction, DIRECTION_DIGITS) <= -180.0))


class TipRecorder:
    """Makes the records of points whose bonds break by energy."""

    def __init__(self, cell: TornCell, loaded: CoupledInterfaces, springs: EnergyCriterion) -> None:
        """`loaded` are the interfaces of the cell.  Collective."""
        self._cell, self._loaded, self._springs = cell, loaded, springs
        self._neighbours = InterfaceNeighbours(cell.comm, cell.solver.jump_operator, cell.subdomains)

    def of(self, point: Point) -> Tips:
        """The tips of a point on every rank, by fibre, interface and direction.  Collective."""
        cell, nodes = self._cell, self._loaded.nodes
        traction = point.scale * self._loaded.traction(point.state.solutions)
        own = tip_energies(self._springs, self._neighbours, point.state.status, traction, point.used)
        direction = bond_directions(cell)[own.node]
        fibre = cell.summary.fibre_number(nodes.fibre[own.node])
        table = np.column_stack([fibre, direction, own.opening, own.shear, own.mode, nodes.pair[own.node]])
        table = np.concatenate(cell.comm.allgather(table))
        table = table[np.lexsort((np.round(table[:, 1], DIRECTION_DIGITS), table[:, 5], table[:, 0]))]
        fibre, angle, opening, shear, mode, pair = table.T
        sections = tuple((pair + 1).astype(int).tolist()) if len(cell.case.interfaces) > 1 else None
        return Tips(tuple(fibre.astype(int).tolist()), angle, opening, shear, mode, sections)
