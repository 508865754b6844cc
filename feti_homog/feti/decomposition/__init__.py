"""The torn cell: subdomains and their kernels, what they share, and the jump operator B between them.

May use `linalg`, `thresholds` and, of the floors below `feti`, `fem` and `mesh`.  Main entries: `partition.decompose`,
`shared_entities.share_entities`, `subdomain.Subdomain` and `jump_operator.JumpOperator`.
"""
