"""Contact of debonded interfaces under one load: open and closed nodes.

Imports `feti`, `interface`, `mesh` and `system`.  Main entries: `contact_problem.ContactProblem` and
`coupled_interfaces.CoupledInterfaces`.
"""

from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Contact, Equilibrium, Status

__all__ = [
    "BONDED", "CLOSED", "OPEN", "BondState", "Contact", "ContactProblem", "CoupledInterfaces", "Equilibrium",
    "Status", "coupled_interfaces",
]  # fmt: skip
