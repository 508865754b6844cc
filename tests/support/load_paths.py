"""Paths of strains in torn cells whose bonds have no memory."""

from typing import Any

import numpy as np

from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, OPEN
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded
from support import torn_cells
from support.loads import strains


def beginning(interface: ContactProblem, debonded: Any = False) -> Any:
    """Return the unloaded point with some nodes debonded, all (True) or none. Collective."""
    status = np.where(np.broadcast_to(debonded, len(interface.nodes.row)), OPEN, BONDED).astype(np.int8)
    return unloaded(CoupledInterfaces(interface), torn_cells.bonds(status))


def followed(interface: ContactProblem, law: Any, waypoints: Any, debonded: Any = False) -> list[Any]:
    """Return the points of a path by events. Collective."""
    loads = strains(np.array(waypoints, float))
    return list(events(CoupledInterfaces(interface), law, loads, beginning(interface, debonded)))
