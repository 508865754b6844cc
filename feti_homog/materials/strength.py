"""Compute the utilisation of phases by strength criteria: 1 at failure, proportional to the stress.

Criteria: maximum principal stress sigma_1 / X; von Mises; Drucker and Prager, fitted to both uniaxial strengths; for
fibres along x3 the largest of Hashin's four modes (J. Appl. Mech. 47 (1980) 329).
"""

from collections.abc import Mapping

import numpy as np

from feti_homog.materials.material_forms import PhaseStrength
from feti_homog.typing import Float

CRITERIA = {
    "maximum principal": ("principal",),
    "von Mises": ("von_mises",),
    "Drucker-Prager": ("tension", "compression"),
    "Hashin": (
        "axial_tension", "axial_compression", "axial_shear", "transverse_tension", "transverse_compression",
        "transverse_shear",
    ),
}  # fmt: skip
"""Criteria with the keys that each criterion needs."""
MODES = ("fibre tension", "fibre compression", "matrix tension", "matrix compression")  # of Hashin


def criterion(strength: PhaseStrength) -> str:
    """Return the name of the criterion that the keys select.

    Raises:
        ValueError: no criterion has exactly these keys.
    """
    names_given = [name for names in CRITERIA.values() for name in names if getattr(strength, name) is not None]
    for title, names in CRITERIA.items():
        if names_given == list(names):
            return title
    groups = "; ".join(f"{', '.join(names)} ({title})" for title, names in CRITERIA.items())
    groups += ". With tension alone write principal, or add compression" if names_given == ["tension"] else ""
    raise ValueError(f"strength: {', '.join(names_given) or 'empty'}: expected the keys of one criterion: {groups}")


def utilisation(strength: PhaseStrength, stress: Float, principal: Float, von_mises: Float) -> Float:
    """Compute the utilisations (n, modes) of a strength under stresses; Hashin has four modes, others one.

    Args:
        stress: (n, 6) in the order [11, 22, 33, 23, 13, 12], x3 along the fibres.
        principal: (n,) largest principal stress.
        von_mises: (n,) von Mises stress.
    """
    limits = {name: float(limit) for name, limit in vars(strength).items() if limit is not None}
    if "principal" in limits:
        ratios = [principal / limits["principal"]]
    elif "von_mises" in limits:
        ratios = [von_mises / limits["von_mises"]]
    elif "tension" in limits:
        # a sigma_vm + b tr sigma, which is 1 under either uniaxial strength.
        tension, compression = 1.0 / limits["tension"], 1.0 / limits["compression"]
        ratios = [(tension + compression) / 2 * von_mises + (tension - compression) / 2 * stress[:, :3].sum(axis=1)]
    else:
        ratios = _hashin(limits, stress)
    return np.asarray(np.maximum(np.stack(ratios, axis=1), 0.0))


def _hashin(limits: Mapping[str, float], stress: Float) -> list[Float]:
    """Compute the utilisations (n,) of the `MODES`, not above 0 for the other sign.

    A mode a f^2 + b f = 1 with the load factor f at failure has the utilisation 1 / f = (b + sqrt(b^2 + 4 a)) / 2.
    """
    S11, S22, S33, S23, S13, S12 = stress.T
    axial, across = np.hypot(S13, S23) / limits["axial_shear"], S11 + S22
    parted = np.hypot(S33 / limits["axial_tension"], axial)
    shear = axial**2 + (S12**2 - S11 * S22) / limits["transverse_shear"] ** 2
    pulled = np.sqrt(np.maximum((across / limits["transverse_tension"]) ** 2 + shear, 0.0))
    doubled, compression = 2 * limits["transverse_shear"], limits["transverse_compression"]
    linear = ((compression / doubled) ** 2 - 1) * across / compression
    pressed = (linear + np.sqrt(linear**2 + 4 * np.maximum((across / doubled) ** 2 + shear, 0.0))) / 2
    return [parted * (S33 > 0), -S33 / limits["axial_compression"], pulled * (across >= 0), pressed * (across < 0)]
