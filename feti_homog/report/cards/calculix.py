"""Cards of CalculiX: Abaqus' keywords, with TYPE=ANISO for all 21 entries.

CalculiX CrunchiX user's manual, *ELASTIC and *EXPANSION; fields of 20 characters are read.  Its alpha12, alpha13,
alpha23 are the tensor's shears, half of the engineering ones.
"""

from __future__ import annotations

import numpy as np

from feti_homog.report.cards import abaqus
from feti_homog.report.cards.card_text import comments
from feti_homog.report.cards.effective_material import EffectiveMaterial

TENSOR_SHEARS = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])


def text(material: EffectiveMaterial) -> str:
    """Return the card."""
    lines = [*comments(material, "**"), *abaqus.elastic(material, "ANISO")]
    if material.expansion is not None and material.is_orthotropic:
        lines += abaqus.expansion("ORTHO", material.expansion[:3])
    elif material.expansion is not None:
        lines += abaqus.expansion("ANISO", (material.expansion * TENSOR_SHEARS)[list(abaqus.ORDER)])
    return "\n".join(lines)
