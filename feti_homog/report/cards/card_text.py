"""Parts that cards share: their first comments, numbers in fields of a given width, names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from textwrap import wrap

from feti_homog.report.cards.effective_material import EffectiveMaterial

LONGEST = 100
AXES = (
    "Axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. So E1, E2, E3, nu12, nu13, nu23, "
    "G12, G13, G23 of this card are E3, E1, E2, nu31, nu32, nu12, G13, G23, G12 of the cell. nu_ij = -eps_j/eps_i "
    "under stress along i."
)


def comments(material: EffectiveMaterial, mark: str) -> list[str]:
    """Return the first lines of a card, each after the mark of a comment, in ASCII."""
    stress = material.stress_unit or "the unit of the moduli in the case file"
    paragraphs = [
        f"Effective material of {material.name}, by feti_homog {material.version}.",
        AXES,
        f"Stresses in {stress}, expansions per unit of temperature; nothing is converted.",
        material.symmetry,
    ]
    if material.expansion is None:
        paragraphs.append("No thermal expansion: not every phase of the case gives one.")
    if material.errors:
        paragraphs.append(f"Estimated errors by the mesh: {_listed(material.errors)}.")
    if material.scatter:
        paragraphs.append(f"Standard deviations by uncertain constants of the phases: {_listed(material.scatter)}.")
    lines = (line for words in paragraphs for line in wrap(_ascii(words), LONGEST))
    return [f"{mark} {line}" for line in lines]


def _listed(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.1e}" for name, value in values.items())


def number(value: float, width: int = 24) -> str:
    """Return the value in at most `width` characters, at least 12: all 17 digits if they fit, else as many as do."""
    value = float(value) + 0.0  # no -0.0
    forms = [repr(value), *(f"{value:.{digits}E}" for digits in range(16, 3, -1))]
    return next(form for form in forms if len(form) <= width)


def identifier(name: str) -> str:
    """Return the name in letters, digits and single underscores.

    It has at most 60 characters, the first of them a letter.
    """
    word = re.sub(r"[\W_]+", "_", name, flags=re.ASCII)[:60].strip("_")
    return word if word[:1].isalpha() else f"material_{word}".strip("_")


def _ascii(text: str) -> str:
    return text.encode("ascii", "backslashreplace").decode()
