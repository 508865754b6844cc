"""The torn cell: subdomains with their kernels, shared entities, and the jump operator B.

Imports `fem`, `feti`, `feti.linalg`, `mesh` and `system`.  Main entries: `partition.decompose`,
`shared_entities.share_entities`, `subdomain.Subdomain` and `jump_operator.JumpOperator`.
"""

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain

__all__ = [
    "JumpOperator", "SharedEntities", "Subdomain", "constraint_layout", "interface_neighbours", "jump_operator",
    "partition", "shared_entities", "sharers",
]  # fmt: skip
