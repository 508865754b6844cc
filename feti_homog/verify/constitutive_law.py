"""Stress from strain in each phase: the constants of the case, taken through the three-dimensional compliance."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.typing import Bool, Float

ISOTROPY = 1e-9  # relative difference of constants of one material
PLANE = [0, 1, 5]  # of the order [11, 22, 33, 23, 13, 12]
# Places of tensor components in the orders [11, 22, 12] and [11, 22, 33, 23, 13, 12].
VOIGT = {3: np.array([[0, 2], [2, 1]]), 6: np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])}
Constants = Mapping[str, Any]


def laws(case: Mapping[str, Any], phases: Sequence[str]) -> tuple[Float, Float | None]:
    """Return stiffnesses (phases, v, v) in the plane state of a case, and strains (phases, v) per temperature.

    Strains are None except in generalized plane strain with expansions of all phases.  Raises CaseError for a phase of
    the mesh without a material.
    """
    constants, plane = [_constants(case, phase) for phase in phases], case["analysis"]["plane"]
    strains = [strain for phase in constants if (strain := _expansion(phase)) is not None]
    known = plane == "generalized" and len(strains) == len(constants)
    return np.stack([_stiffness(phase, plane) for phase in constants]), np.stack(strains) if known else None


def mixed_phases(case: Mapping[str, Any], phases: Sequence[str]) -> Bool:
    """(phases,) True where quadratic elements have a bubble and a pressure: isotropic phases, not in plane stress.

    Cases of older versions may have another `element`.  Raises CaseError as `laws` does.
    """
    mixed = case["cell"].get("element", "mixed") == "mixed" and case["analysis"]["plane"] != "stress"
    return np.array([mixed and _is_isotropic(_constants(case, phase)) for phase in phases], bool)


def _is_isotropic(constants: Constants) -> bool:
    """Return True if one modulus and one ratio determine all constants, to ISOTROPY."""
    if "E_transverse" not in constants:
        return "young" in constants
    E, nu = float(constants["E_transverse"]), float(constants["nu_transverse"])
    axial = [constants.get("E_axial"), constants.get("nu_axial")]
    axial += [constants["G_axial"]] if constants.get("G_axial") is not None else []
    expected = [E, nu, E / 2 / (1 + nu)][: len(axial)]
    return None not in axial and bool(np.allclose(np.array(axial, float), expected, rtol=ISOTROPY, atol=0))


def out_of_plane(case: Mapping[str, Any], phases: Sequence[str]) -> Float:
    """(phases, 2, 3) from [S11, S22, S12] to [S33, E33]; NaN where constants leave it open.  Raises as `laws`.

    E33 = s13 S11' + s23 S22' + s36 S12' + s33 S33 with the stresses in the material axes; one of S33, E33 is 0.
    """
    plane, rules = case["analysis"]["plane"], []
    for constants in (_constants(case, phase) for phase in phases):
        rule, zero = np.full(3, np.nan), np.zeros(3)
        if _determines_out_of_plane(constants, plane):
            compliance, (a, b) = _compliance(constants), _turn(float(constants.get("angle", 0.0)), 2).T
            # S11' = a S a and S12' = a S b with the axes a and b; [S11, S22, S12] has S12 once.
            stresses = [[p[0] * q[0], p[1] * q[1], p[0] * q[1] + p[1] * q[0]] for p, q in ((a, a), (b, b), (a, b))]
            rule = np.array(stresses).T @ compliance[2, PLANE] * (-1 / compliance[2, 2] if plane == "strain" else 1.0)
        rules.append([rule, zero] if plane == "strain" else [zero, rule])
    return np.array(rules)


def _determines_out_of_plane(constants: Constants, plane: str) -> bool:
    if "stiffness" in constants:
        return len(constants["stiffness"]) == 6
    names = {"young": ("poisson",), "E_transverse": ("E_axial", "nu_axial"), "E1": ("nu13", "nu23")}
    form = next(name for name in names if name in constants)
    third = ("E3",) if form == "E1" and plane == "strain" else ()
    return all(constants.get(name) is not None for name in (*names[form], *third))


def _constants(case: Mapping[str, Any], phase: str) -> Constants:
    materials = case["material"]
    constants = materials.get(phase, materials.get(phase.partition(":")[0]))
    if not isinstance(constants, Mapping):
        raise CaseError(f"result.json: its case has no material for the phase {phase} of result.h5")
    return constants


def _stiffness(constants: Constants, plane: str) -> Float:
    """In the axes of the cell; without E33, gamma13 and gamma23, or in plane stress S33, S13 and S23."""
    stiffness = _given_stiffness(constants)
    if len(stiffness) == 3:
        return stiffness
    law = stiffness if len(stiffness) else np.asarray(np.linalg.inv(_compliance(constants)), float)
    if plane == "stress":
        law = np.asarray(np.linalg.inv(_compliance(constants)[np.ix_(PLANE, PLANE)]), float)
    elif plane == "strain":
        law = law[np.ix_(PLANE, PLANE)]
    return turned(law, float(constants.get("angle", 0.0)))


def _expansion(constants: Constants) -> Float | None:
    """R_ip R_jq alpha_pq of the strains along the material axes."""
    across, along = (constants.get(f"expansion_{name}") for name in ("transverse", "axial"))
    strains = constants.get("expansion") if across is None or along is None else [across, across, along]
    if strains is None:
        return None
    turn = _turn(float(constants.get("angle", 0.0)), 3)
    tensor = turn @ np.diag(np.broadcast_to(np.array(strains, float), 3)) @ turn.T
    return np.array([*np.diag(tensor), 2 * tensor[1, 2], 2 * tensor[0, 2], 2 * tensor[0, 1]])


def _given_stiffness(constants: Constants) -> Float:
    """Stiffness among the constants, (3, 3) or (6, 6); (0, 0) if there is none."""
    stiffness = np.array(constants.get("stiffness", np.zeros((0, 0))), float)
    return np.asarray((stiffness + stiffness.T) / 2)


def _compliance(constants: Constants) -> Float:
    """(6, 6) in the material axes; constants that plane stress does not need are arbitrary stable ones."""
    if "stiffness" in constants:
        return np.asarray(np.linalg.inv(_given_stiffness(constants)), float)
    moduli, ratios, shears = _engineering_constants(constants)
    compliance = np.diag(1 / np.array([*moduli, *shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def _engineering_constants(constants: Constants) -> tuple[list[float], list[float], list[float]]:
    """Young's moduli along three axes, the ratios 12, 13, 23, and the shear moduli 23, 13, 12."""
    if "young" in constants:
        e, nu = float(constants["young"]), float(constants["poisson"])
        return [e, e, e], [nu, nu, nu], [e / (2 * (1 + nu))] * 3
    if "E_transverse" in constants:
        e, nu = float(constants["E_transverse"]), float(constants["nu_transverse"])
        along = float(constants.get("E_axial") or e)
        # Under stress along x1 the phase contracts along x3 by nu_axial e / along: compliances are symmetric.
        minor, shear = float(constants.get("nu_axial") or 0.0) * e / along, e / (2 * (1 + nu))
        axial = float(constants.get("G_axial") or shear)
        return [e, e, along], [nu, minor, minor], [axial, axial, shear]
    moduli = [float(constants[name]) for name in ("E1", "E2")]
    ratios = [float(constants.get(name) or 0.0) for name in ("nu12", "nu13", "nu23")]
    shears = [float(constants.get(name) or constants["G12"]) for name in ("G23", "G13", "G12")]
    return [*moduli, float(constants.get("E3") or moduli[0])], ratios, shears


def turned(stiffness: Float, degrees: float) -> Float:
    """C_ijkl = R_ip R_jq R_kr R_ls C'_pqrs in axes x1, x2, (x3); axis 1 of C' is `degrees` from x1 to x2."""
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
