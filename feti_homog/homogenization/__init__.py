"""From a case to the torn cell, and from solutions to averages.

Imports `case`, `fem`, `feti`, `interface`, `materials`, `mesh`, `microstructure`, `schema` and `system`.  Main entries:
`unit_cell.tear` and `averaging.Homogenization`.
"""

__all__ = [
    "averaging", "cell_remarks", "domain_partition", "energy_release", "mesh_estimate", "partition_policy",
    "phase_laws", "recovered_fields", "stiffness_derivatives", "tile_tearing", "uniform_parts", "unit_cell",
]  # fmt: skip
