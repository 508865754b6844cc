"""Define, read and check a case file before anything is computed.

Imports `materials`, `microstructure`, `schema` and `system`. Starts neither MPI nor PETSc.  Main entries: `cases.load`
and `cases.parse`; `reference` describes the file.
"""

from feti_homog.case.cases import Case

__all__ = [
    "Case", "bond_laws", "cases", "cell_section", "cell_sizes", "interface_section", "load_sections",
    "material_sections", "reference", "sections", "toml_files",
]  # fmt: skip
