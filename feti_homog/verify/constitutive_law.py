"""Stress from strain in each phase: the constants of the case, taken through the three-dimensional compliance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.typing import Bool, Float

ISOTROPY = 1e-9  # relative difference of constants of one material
PLANE = [0, 1, 5]  # of the order [11, 22, 33, 23, 13, 12]
# Places of the components of a tensor in the orders [11, 22, 12] and [11, 22, 33, 23, 13, 12].
VOIGT = {3: np.array([[0, 2], [2, 1]]), 6: np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])}


def laws(case: Mapping[str, Any], phases: Sequence[str]) -> tuple[Float, Float | None]:
    """Return the stiffnesses (phases, v, v) of the plane state of a case, and strains (phases, v) per temperature.

    Strains are None but in generalized plane strain, and where a phase does not give them.  Raises CaseError for a
    phase of the mesh without a material.
    """
    constants, plane = [_constants(case, phase) for phase in phases], case["analysis"]["plane"]
    stiffnesses = np.stack([_stiffness(own, plane) for own in constants])
    strains = [strain for own in constants if (strain := _expansion(own)) is not None]
    known = plane == "generalized" and len(strains) == len(constants)
    return stiffnesses, np.stack(strains) if known else None


def mixed_phases(case: Mapping[str, Any], phases: Sequence[str]) -> Bool:
    """(phases,) whether quadratic elements have a bubble and a pressure: those of isotropic phases but in plane stress.

    Cases of older versions may have another `element`.  Raises CaseError as `laws` does.
    """
    wanted = case["cell"].get("element", "mixed") == "mixed" and case["analysis"]["plane"] != "stress"
    return np.array([wanted and _is_isotropic(_constants(case, phase)) for phase in phases], bool)


def _is_isotropic(constants: Mapping[str, Any]) -> bool:
    """Return whether one modulus and one ratio determine all, to ISOTROPY."""
    if "E_transverse" in constants:
        E, nu = float(constants["E_transverse"]), float(constants["nu_transverse"])
        known = [constants.get("E_axial"), constants.get("nu_axial")]
        known += [constants["G_axial"]] if constants.get("G_axial") is not None else []
        expected = [E, nu, E / 2 / (1 + nu)][: len(known)]
        return None not in known and bool(np.allclose(np.array(known, float), expected, rtol=ISOTROPY, atol=0))
    return "young" in constants


def out_of_plane(case: Mapping[str, Any], phases: Sequence[str]) -> Float:
    """(phases, 2, 3) from [S11, S22, S12] to [S33, E33]; NaN where constants leave it open.  Raises as `laws`."""
    return np.stack([_out_of_plane(_constants(case, phase), case["analysis"]["plane"]) for phase in phases])


def _constants(case: Mapping[str, Any], phase: str) -> Mapping[str, Any]:
    materials = case["material"]
    constants = materials.get(phase, materials.get(phase.partition(":")[0]))
    if not isinstance(constants, Mapping):
        raise CaseError(f"result.json: its case has no material for the phase {phase} of result.h5")
    found: Mapping[str, Any] = constants
    return found


def _out_of_plane(constants: Mapping[str, Any], plane: str) -> Float:
    """E33 = s13 S11' + s23 S22' + s36 S12' + s33 S33 with the stresses in the material axes; one of S33, E33 is 0."""
    nothing = np.zeros(3)
    if _says_out_of_plane(constants, plane):
        compliance = _compliance(constants)
        share = compliance[2, 2] if plane == "strain" else -1.0
        angle = np.radians(float(constants.get("angle", 0.0)))
        a, b = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        # S11' = a S a and S12' = a S b with the axes a and b; [S11, S22, S12] has S12 once.
        stresses = [[p[0] * q[0], p[1] * q[1], p[0] * q[1] + p[1] * q[0]] for p, q in ((a, a), (b, b), (a, b))]
        rule = -np.array(stresses).T @ compliance[2, PLANE] / share
    else:
        rule = np.full(3, np.nan)
    return np.stack([rule, nothing] if plane == "strain" else [nothing, rule])


def _says_out_of_plane(constants: Mapping[str, Any], plane: str) -> bool:
    """Return whether the constants determine S33 or E33."""
    if "stiffness" in constants:
        return len(constants["stiffness"]) == 6
    wanted = {"young": ("poisson",), "E_transverse": ("E_axial", "nu_axial"), "E1": ("nu13", "nu23")}
    form = next(name for name in wanted if name in constants)
    third = ("E3",) if form == "E1" and plane == "strain" else ()
    return all(constants.get(name) is not None for name in (*wanted[form], *third))


def _stiffness(constants: Mapping[str, Any], plane: str) -> Float:
    """In the axes of the cell; without E33, gamma13 and gamma23, or in plane stress S33, S13 and S23."""
    given = _given(constants)
    if len(given) == 3:
        return given
    law = given if len(given) else np.asarray(np.linalg.inv(_compliance(constants)), float)
    if plane == "stress":
        law = np.asarray(np.linalg.inv(_compliance(constants)[np.ix_(PLANE, PLANE)]), float)
    elif plane == "strain":
        law = law[np.ix_(PLANE, PLANE)]
    return turned(law, float(constants.get("angle", 0.0)))


def _expansion(constants: Mapping[str, Any]) -> Float | None:
    """R_ip R_jq alpha_pq of the strains along the material axes."""
    across, along = (constants.get(f"expansion_{name}") for name in ("transverse", "axial"))
    given = constants.get("expansion") if across is None or along is None else [across, across, along]
    if given is None:
        return None
    turn = _turn(float(constants.get("angle", 0.0)), 3)
    tensor = turn @ np.diag(np.broadcast_to(np.array(given, float), 3)) @ turn.T
    return np.array([*np.diag(tensor), 2 * tensor[1, 2], 2 * tensor[0, 2], 2 * tensor[0, 1]])


def _given(constants: Mapping[str, Any]) -> Float:
    """Return the stiffness that the constants give themselves, (3, 3) or (6, 6); (0, 0) if they do not."""
    given = np.array(constants.get("stiffness", np.zeros((0, 0))), float)
    return np.asarray((given + given.T) / 2)


def _compliance(constants: Mapping[str, Any]) -> Float:
    """(6, 6) in the material axes; out of plane constants that plane stress does not need are any that are stable."""
    if "stiffness" in constants:
        return np.asarray(np.linalg.inv(_given(constants)), float)
    moduli, ratios, shears = _engineering_constants(constants)
    compliance = np.diag(1 / np.array([*moduli, *shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def _engineering_constants(constants: Mapping[str, Any]) -> tuple[list[float], list[float], list[float]]:
    """Young's moduli along three axes, the ratios 12, 13, 23, and the shear moduli 23, 13, 12."""
    if "young" in constants:
        e, nu = float(constants["young"]), float(constants["poisson"])
        return [e, e, e], [nu, nu, nu], [e / (2 * (1 + nu))] * 3
    if "E_transverse" in constants:
        e, nu = float(constants["E_transverse"]), float(constants["nu_transverse"])
        along = float(constants.get("E_axial") or e)
        # Under stress along x1 the phase contracts along x3 by nu_axial e / along: compliances are symmetric.
        minor = float(constants.get("nu_axial") or 0.0) * e / along
        shear = e / (2 * (1 + nu))
        axial = float(constants.get("G_axial") or shear)
        return [e, e, along], [nu, minor, minor], [axial, axial, shear]
    moduli = [float(constants[name]) for name in ("E1", "E2")]
    ratios = [float(constants.get(name) or 0.0) for name in ("nu12", "nu13", "nu23")]
    shears = [float(constants.get(name) or constants["G12"]) for name in ("G23", "G13", "G12")]
    return [*moduli, float(constants.get("E3") or moduli[0])], ratios, shears


def turned(stiffness: Float, degrees: float) -> Float:
    """C_ijkl = R_ip R_jq R_kr R_ls C'_pqrs in axes x1, x2, (x3) of a material.

    Its axis 1 is `degrees` from x1 to x2.
    """
    voigt = VOIGT[len(stiffness)]
    turn = _turn(degrees, len(voigt))
    tensor = stiffness[voigt[:, :, None, None], voigt[None, None]]
    tensor = np.einsum("ip,jq,kr,ls,pqrs->ijkl", turn, turn, turn, turn, tensor, optimize=True)
    i, j = np.transpose([np.argwhere(voigt == number)[0] for number in range(len(stiffness))])
    return np.asarray(tensor[i[:, None], j[:, None], i[None], j[None]])


def _turn(degrees: float, axes: int) -> Float:
    """(axes, axes) R of a turn from x1 to x2."""
    angle, turn = np.radians(degrees), np.eye(axes)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
