"""Cards of ANSYS Mechanical APDL.

Material Reference, linear elasticity: PRXY, PRYZ, PRXZ are the major Poisson's ratios, PRXY = -eps_y/eps_x under stress
along x; TB,ANEL takes the lower triangle of the stiffness (TBOPT = 0) by columns, in the order [x, y, z, xy, yz, xz]
with engineering shears.  ALPX, ALPY, ALPZ are secant coefficients; there are none of shears.
"""

from __future__ import annotations

from feti_homog.errors import CaseError
from feti_homog.report.cards.effective_material import EffectiveMaterial, comments, number

ORDER = (0, 1, 2, 5, 3, 4)
"""Where in [11, 22, 33, 23, 13, 12] the components of [x, y, z, xy, yz, xz] stand."""
ENTRIES = tuple((ORDER[row], ORDER[column]) for column in range(6) for row in range(column, 6))
"""Rows and columns of D11, D21, ..., D61, D22, ..., D66."""
LABELS = {
    "EX": "E1", "EY": "E2", "EZ": "E3", "PRXY": "nu12", "PRYZ": "nu23", "PRXZ": "nu13",
    "GXY": "G12", "GYZ": "G23", "GXZ": "G13",
}  # fmt: skip
NUMBER, PER_LINE = 1, 6


def text(material: EffectiveMaterial) -> str:
    """Return the card. Raises CaseError for an expansion with shears."""
    alpha = material.expansion
    if alpha is not None and alpha[3:].any():
        raise CaseError(
            "its thermal expansion has shears in its axes, for which ANSYS has no constants; "
            "use --transversely-isotropic"
        )
    lines = [*comments(material, "!"), f"! Material {NUMBER}; x, y, z are axes 1, 2, 3. To be read in /PREP7."]
    if material.is_orthotropic:
        lines += [f"MP,{label},{NUMBER},{number(material.constants[name])}" for label, name in LABELS.items()]
    else:
        C = material.stiffness
        values = [number(C[i, j]) for i, j in ENTRIES]
        lines += ["! Stiffness in the order x, y, z, xy, yz, xz: D11, D21, D31, D41, D51, D61, D22, ..., D66"]
        lines += [f"TB,ANEL,{NUMBER},1,21,0"]
        lines += [f"TBDATA,{k + 1},{','.join(values[k : k + PER_LINE])}" for k in range(0, len(values), PER_LINE)]
    if alpha is not None:
        lines += [f"MP,ALP{axis},{NUMBER},{number(alpha[i])}" for i, axis in enumerate("XYZ")]
    return "\n".join(lines)
