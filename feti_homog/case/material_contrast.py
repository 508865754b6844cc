"""How far the stiffnesses of the phases are apart, of which double precision bears only so much."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from feti_homog.case.material_forms import Material
from feti_homog.case.materials import plane_stiffness, spatial_stiffness
from feti_homog.case.selectors import GENERALIZED
from feti_homog.case.wording import toml_key

# Beyond the first, rounding of displacements makes stresses as large as those of the soft phase are allowed to be off;
# beyond the second, it leaves nothing of them.
WORRYING_CONTRAST, LARGEST_CONTRAST = 1e10, 1e14


def contrast_faults(materials: Mapping[str, Material], plane: str) -> list[str]:
    """A fault if the phases are too far apart; their constants are those of stable materials."""
    contrast, phases = _contrast(materials, plane)
    if contrast <= LARGEST_CONTRAST:
        return []
    return [f"{phases}: stiffnesses that differ by a factor of {contrast:.1e}: expected at most {LARGEST_CONTRAST:g}"]


def contrast_warnings(materials: Mapping[str, Material], plane: str) -> list[str]:
    """A warning if rounding may matter."""
    contrast, phases = _contrast(materials, plane)
    if contrast <= WORRYING_CONTRAST:
        return []
    return [f"{phases}: stiffnesses differ by a factor of {contrast:.1e}: rounding may exceed what the checks allow"]


def _contrast(materials: Mapping[str, Material], plane: str) -> tuple[float, str]:
    """The largest ratio of the largest entries of two phases' stiffnesses, and the sections of these phases."""
    law = spatial_stiffness if plane in GENERALIZED.values else partial(plane_stiffness, plane=plane)
    with np.errstate(over="ignore"):
        sizes = {phase: float(np.abs(law(material)).max()) for phase, material in materials.items()}
    stiffest, softest = max(sizes, key=sizes.__getitem__), min(sizes, key=sizes.__getitem__)
    names = ", ".join(f"[material.{toml_key(phase)}]" for phase in (stiffest, softest))
    return sizes[stiffest] / sizes[softest], names
