"""Cards of Abaqus, and those of CalculiX with its keywords.

Abaqus Keywords Guide, *ELASTIC and *EXPANSION: engineering constants are E1, E2, E3, nu12, nu13, nu23, G12, G13 and, on
the next line, G23, where nu_ij is the strain along j under stress along i; TYPE=ANISOTROPIC takes the 21 entries
D_ijkl of `ENTRIES`, eight to a line.  Numbers have up to 20 characters (Input syntax rules).

CalculiX CrunchiX user's manual, *ELASTIC and *EXPANSION; fields of 20 characters are read.  Its alpha12, alpha13,
alpha23 are the tensor's shears, half of the engineering ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.report.cards.effective_material import PAIRS, EffectiveMaterial, comments, identifier, number
from feti_homog.typing import Float

WIDTH, PER_LINE = 20, 8
TENSOR_SHEARS = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
ORDER = (0, 1, 2, 5, 4, 3)
"""Where in [11, 22, 33, 23, 13, 12] the components of Abaqus' order [11, 22, 33, 12, 13, 23] stand."""
ENTRIES = tuple((ORDER[row], ORDER[column]) for column in range(6) for row in range(column + 1))
"""Rows and columns of D1111, D1122, D2222, D1133, ..., D2323: the upper triangle by columns."""


def text(material: EffectiveMaterial) -> str:
    """Return the card. Raises CaseError for an expansion with shears."""
    if material.expansion is not None and material.expansion[3:].any():
        # Abaqus' guide leaves open whether alpha12 of TYPE=ANISO is the tensor's shear or the engineering one.
        raise CaseError(
            "its thermal expansion has shears in its axes, which cards for Abaqus do not carry; "
            "use --transversely-isotropic"
        )
    lines = [*comments(material, "**"), *elastic(material, "ANISOTROPIC")]
    if material.expansion is not None:
        lines += expansion("ORTHO", material.expansion[:3])
    return "\n".join(lines)


def elastic(material: EffectiveMaterial, anisotropic: str) -> Iterator[str]:
    """*MATERIAL and *ELASTIC; `anisotropic` is the TYPE of all 21 entries."""
    yield f"*MATERIAL, NAME={identifier(material.name)}"
    if material.is_orthotropic:
        yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
        yield "** E1, E2, E3, nu12, nu13, nu23, G12, G13, and on the next line G23"
        yield from data_lines(material.constants.values())
    else:
        C = material.stiffness
        names = ["D" + "".join(str(axis + 1) for axis in (*PAIRS[i], *PAIRS[j])) for i, j in ENTRIES]
        yield f"*ELASTIC, TYPE={anisotropic}"
        yield from (f"** {', '.join(names[k : k + PER_LINE])}" for k in range(0, len(names), PER_LINE))
        yield from data_lines(C[i, j] for i, j in ENTRIES)


def expansion(kind: str, values: Float) -> list[str]:
    """*EXPANSION of this TYPE."""
    return [f"*EXPANSION, TYPE={kind}", *data_lines(values)]


def data_lines(values: Iterable[float]) -> list[str]:
    """Return the numbers, separated by commas, eight to a line."""
    fields = [number(value, WIDTH) for value in values]
    return [", ".join(fields[k : k + PER_LINE]) for k in range(0, len(fields), PER_LINE)]


def calculix_text(material: EffectiveMaterial) -> str:
    """Return the card of CalculiX, with TYPE=ANISO for all 21 entries."""
    lines = [*comments(material, "**"), *elastic(material, "ANISO")]
    if material.expansion is not None and material.is_orthotropic:
        lines += expansion("ORTHO", material.expansion[:3])
    elif material.expansion is not None:
        lines += expansion("ANISO", (material.expansion * TENSOR_SHEARS)[list(ORDER)])
    return "\n".join(lines)
