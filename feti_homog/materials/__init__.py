"""Materials: their constants, laws and bounds, Voigt's notation, closed formulas of the mechanics of composites.

Imports `schema` and `system`.  Main entries: `material_forms`, `laws`, `engineering_constants`, `phase_bounds`,
`estimates`.
"""

__all__ = [
    "engineering_constants", "estimates", "laws", "material_derivatives", "material_forms", "phase_bounds", "strength",
    "voigt",
]  # fmt: skip
