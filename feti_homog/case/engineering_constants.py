"""The compliance of phases that are given by engineering constants, and which constants are those of no material."""

from __future__ import annotations

import numpy as np

from feti_homog.case.material_forms import Orthotropic, TransverselyIsotropic
from feti_homog.case.voigt_matrices import is_positive_definite
from feti_homog.case.wording import limit_in_words
from feti_homog.typing import Float

PLANE_IN_WORDS = {"strain": "plane strain", "generalized": "generalized plane strain"}
NEEDED: dict[type[Orthotropic] | type[TransverselyIsotropic], dict[str, tuple[str, ...]]] = {
    Orthotropic: {"strain": ("E3", "nu13", "nu23"), "generalized": ("E3", "nu13", "nu23", "G13", "G23")},
    TransverselyIsotropic: {"strain": ("E_axial", "nu_axial"), "generalized": ("E_axial", "nu_axial", "G_axial")},
}
"""The optional constants that a plane state needs."""


def stable_compliance(material: Orthotropic | TransverselyIsotropic, plane: str) -> Float:
    """Compliance (6, 6) in the material axes, checked as far as the plane state needs it."""
    compliance = known_compliance(material)
    if not is_positive_definite(compliance[:2, :2]):
        raise ValueError(f"{_limit_in_plane(material)}; no material is stable otherwise")
    absent = [name for name in NEEDED[type(material)].get(plane, ()) if getattr(material, name) is None]
    if absent:
        needs = "needs it" if len(absent) == 1 else "needs them"
        raise ValueError(f"{', '.join(absent)}: missing; {PLANE_IN_WORDS[plane]} {needs}")
    if plane != "stress" and not is_positive_definite(compliance[:3, :3]):
        raise ValueError(_limit_in_space(material))
    return compliance


def known_compliance(material: Orthotropic | TransverselyIsotropic) -> Float:
    """Compliance (6, 6) in the material axes; NaN where the constants do not say it."""
    if isinstance(material, TransverselyIsotropic):
        E1, E3, G13, nu31 = _numbers(material.E_transverse, material.E_axial, material.G_axial, material.nu_axial)
        nu12, nu13 = material.nu_transverse, nu31 * E1 / E3
        G12 = E1 / (2.0 * (1.0 + nu12))
        moduli, ratios, shears = [E1, E1, E3], [nu12, nu13, nu13], [G13, G13, G12]
    else:
        moduli = _numbers(material.E1, material.E2, material.E3)
        ratios = _numbers(material.nu12, material.nu13, material.nu23)
        shears = _numbers(material.G23, material.G13, material.G12)
    compliance = np.diag(1.0 / np.array([*moduli, *shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def _numbers(*constants: float | None) -> list[float]:
    """The constants, NaN for those that are not given."""
    return [np.nan if constant is None else constant for constant in constants]


def _limit_in_plane(material: Orthotropic | TransverselyIsotropic) -> str:
    """What is wrong with the constants of the plane."""
    if isinstance(material, TransverselyIsotropic):
        return f"nu_transverse = {material.nu_transverse}: expected a number above -1 and below 1"
    limit = limit_in_words(material.E1 / material.E2, material.nu12**2, 6)
    return f"nu12 = {material.nu12}: expected nu12^2 < E1/E2 = {limit}"


def _limit_in_space(material: Orthotropic | TransverselyIsotropic) -> str:
    """What is wrong with constants of which those of the plane are right."""
    if isinstance(material, Orthotropic):
        return "E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance"
    E_transverse, E_axial, nu_axial = _numbers(material.E_transverse, material.E_axial, material.nu_axial)
    limit = limit_in_words((1.0 - material.nu_transverse) * E_axial / (2.0 * E_transverse), nu_axial**2, 6)
    words = "nu_axial^2 < (1 - nu_transverse) E_axial/(2 E_transverse)"
    return f"nu_axial = {nu_axial}: expected {words} = {limit}; no material is stable otherwise"
