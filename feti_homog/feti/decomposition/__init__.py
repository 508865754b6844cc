"""The torn cell: subdomains and their kernels, shared entities, and the jump operator B between them.

Imports `fem`, `feti`, `feti.linalg`, `mesh` and `system`.  Main entries: `partition.decompose`,
`shared_entities.share_entities`, `subdomain.Subdomain` and `jump_operator.JumpOperator`.
"""
