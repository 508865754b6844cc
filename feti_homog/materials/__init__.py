"""Materials: constants, laws, bounds, Voigt's notation, and closed formulas of composite mechanics.

Imports `schema` and `system`.  Main entries: `material_forms`, `laws`, `engineering_constants`, `phase_bounds`,
`estimates`.
"""

__all__ = [
    "engineering_constants", "estimates", "laws", "material_derivatives", "material_forms", "phase_bounds", "voigt",
]  # fmt: skip
