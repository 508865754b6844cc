"""Compute the stiffness of every phase from the constants of the case, by the three-dimensional compliance."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.typing import Bool, Float
from feti_homog.verify.findings import ROUNDING

PLANE = [0, 1, 5]  # positions of 11, 22 and 12 in the order [11, 22, 33, 23, 13, 12]
GRADIENT = [4, 3, 2]  # positions of dT/dx1, dT/dx2 and dT/dx3 in that order
# Positions of tensor components in the orders [11, 22, 12] and [11, 22, 33, 23, 13, 12].
VOIGT = {3: np.array([[0, 2], [2, 1]]), 6: np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])}
Constants = Mapping[str, Any]


def laws(case: Mapping[str, Any], phases: Sequence[str]) -> tuple[Float, Float]:
    """Compute stiffnesses (phases, v, v) and expansions (phases, v) in the axes of the cell.

    In plane strain E33, gamma13 and gamma23 are 0, in plane stress S33, S13 and S23.  In generalized plane strain,
    expansions are R_ip R_jq alpha_pq per temperature, with the rotation R of the material axes, if all phases have
    alpha; else 0.  In conduction the temperature is a displacement along x3.  Raises CaseError without a material.
    """
    plane, stiffnesses, expansions = case["analysis"]["plane"], list[Float](), list[Float]()
    for constants in (phase_constants(case, phase) for phase in phases):
        angle = float(constants.get("angle", 0.0))
        if plane == "conduction":
            # C_3i3j = k_ij for a displacement along x3 alone; the rest is arbitrary, of the size of k.
            k: Any = constants["conductivity"]
            tensor = np.array([k["transverse"], k["transverse"], k["axial"]] if isinstance(k, Mapping) else k, float)
            tensor = tensor * np.eye(3) if tensor.ndim < 2 else tensor
            stiffnesses.append(np.abs(tensor).max() * np.eye(6))
            stiffnesses[-1][np.ix_(GRADIENT, GRADIENT)] = _turn(angle, 3) @ (tensor + tensor.T) / 2 @ _turn(angle, 3).T
            continue
        law = _given_stiffness(constants)
        if len(law) != 3:
            law = law if len(law) else np.asarray(np.linalg.inv(_compliance(constants)), float)
            if plane == "stress":
                law = np.asarray(np.linalg.inv(_compliance(constants)[np.ix_(PLANE, PLANE)]), float)
            elif plane == "strain":
                law = law[np.ix_(PLANE, PLANE)]
            law = turned(law, angle)
        stiffnesses.append(law)
        across, along = (constants.get(f"expansion_{name}") for name in ("transverse", "axial"))
        strains = constants.get("expansion") if across is None or along is None else [across, across, along]
        if strains is not None:
            turn = _turn(angle, 3)
            tensor = turn @ np.diag(np.broadcast_to(np.array(strains, float), 3)) @ turn.T
            expansions.append(np.array([*np.diag(tensor), 2 * tensor[1, 2], 2 * tensor[0, 2], 2 * tensor[0, 1]]))
    expands = plane == "generalized" and len(expansions) == len(phases)
    return np.stack(stiffnesses), np.stack(expansions) if expands else np.zeros((len(phases), len(stiffnesses[0])))


def mixed_phases(case: Mapping[str, Any], phases: Sequence[str]) -> Bool:
    """Return whether quadratic elements of each phase (phases,) have a bubble and a pressure.

    Elements of isotropic phases are mixed, except in plane stress and conduction.  In an isotropic phase one modulus
    and one ratio give all constants, up to rounding.  Raises like `laws`.
    """
    mixed = []
    for constants in (phase_constants(case, phase) for phase in phases):
        is_isotropic = "young" in constants
        if constants.get("E_axial") is not None and constants.get("nu_axial") is not None:
            compliance = _compliance(constants)
            isotropic = {"young": constants["E_transverse"], "poisson": -compliance[0, 1] / compliance[0, 0]}
            is_isotropic = np.allclose(compliance, _compliance(isotropic), rtol=ROUNDING, atol=0)
        mixed.append(is_isotropic)
    return np.asarray(np.array(mixed, bool) & (case["analysis"]["plane"] not in ("stress", "conduction")))


def rounding(case: Mapping[str, Any], phases: Sequence[str], stiffnesses: Float) -> tuple[float, float]:
    """Bound the relative rounding of stresses, 6 eps times a condition, and of work, 6 eps times the contrast.

    eps is the machine precision, the condition the largest S_iijj / (3 min eig S) of all phase compliances S.
    """
    constants = [] if case["analysis"]["plane"] == "conduction" else [phase_constants(case, name) for name in phases]
    compliances = [_compliance(phase) for phase in constants]  # incompressible phases have limits of pressures
    condition = max((S[:3, :3].sum() / 3 * np.linalg.norm(np.linalg.inv(S), 2) for S in compliances), default=1.0)
    sizes, lost = np.abs(stiffnesses).max(axis=(1, 2)), 6 * np.finfo(float).eps
    return float(lost * condition), float(lost * sizes.max() / sizes.min())


def out_of_plane(case: Mapping[str, Any], phases: Sequence[str]) -> Float:
    """Compute matrices (phases, 2, 3) from [S11, S22, S12] to [S33, E33].

    E33 = s13 S11' + s23 S22' + s36 S12' + s33 S33 with compliances s and stresses S' in material axes; S33 or E33 is 0.
    The row that is not 0 is NaN if the constants do not determine it.  Raises like `laws`.
    """
    plane, rules = case["analysis"]["plane"], []
    beside_E1 = ["nu13", "nu23", "E3"] if plane == "strain" else ["nu13", "nu23"]
    needed = {"young": ["poisson"], "E_transverse": ["E_axial", "nu_axial"], "E1": beside_E1}
    for constants in (phase_constants(case, phase) for phase in phases):
        rule, zero = np.full(3, np.nan), np.zeros(3)
        names = next((names for form, names in needed.items() if form in constants), [])
        if all(constants.get(name) is not None for name in names) and len(constants.get("stiffness", ())) != 3:
            compliance, (a, b) = _compliance(constants), _turn(float(constants.get("angle", 0.0)), 2).T
            # S11' = a S a and S12' = a S b with the axes a and b; [S11, S22, S12] has S12 once.
            stresses = [[p[0] * q[0], p[1] * q[1], p[0] * q[1] + p[1] * q[0]] for p, q in ((a, a), (b, b), (a, b))]
            rule = np.array(stresses).T @ compliance[2, PLANE] * (-1 / compliance[2, 2] if plane == "strain" else 1.0)
        rules.append([rule, zero] if plane == "strain" else [zero, rule])
    return np.array(rules)


def phase_constants(case: Mapping[str, Any], phase: str) -> Constants:
    """Return the constants of a phase.  Raises CaseError if it has no material."""
    materials = case["material"]
    constants = materials.get(phase, materials.get(phase.partition(":")[0]))
    if not isinstance(constants, Mapping):
        raise CaseError(f"result.json: the case has no material for the phase {phase} of result.h5")
    return constants


def _given_stiffness(constants: Constants) -> Float:
    """Return the symmetric part of the constant `stiffness`, (3, 3) or (6, 6).  Without it the result is (0, 0)."""
    stiffness = np.array(constants.get("stiffness", np.zeros((0, 0))), float)
    return np.asarray((stiffness + stiffness.T) / 2)


def _compliance(constants: Constants) -> Float:
    """Compute the compliance S (6, 6) in the material axes; (3, 3) if the given stiffness is (3, 3).

    Young's moduli along three axes, ratios 12, 13, 23 and shear moduli 23, 13, 12 determine S; plane stress needs fewer
    constants, and the others have arbitrary stable values.
    """
    if "stiffness" in constants:
        return np.asarray(np.linalg.inv(_given_stiffness(constants)), float)
    if "young" in constants:
        e, nu = float(constants["young"]), float(constants["poisson"])
        moduli, ratios, shears = [e, e, e], [nu, nu, nu], [e / (2 * (1 + nu))] * 3
    elif "E_transverse" in constants:
        e, shear = float(constants["E_transverse"]), float(constants.get("G_transverse") or 0.0)
        nu = e / (2 * shear) - 1 if shear else float(constants["nu_transverse"])
        along = float(constants.get("E_axial") or e)
        # Under stress along x1 the phase contracts along x3 by nu_axial e / along: compliances are symmetric.
        minor, shear = float(constants.get("nu_axial") or 0.0) * e / along, e / (2 * (1 + nu))
        axial = float(constants.get("G_axial") or shear)
        moduli, ratios, shears = [e, e, along], [nu, minor, minor], [axial, axial, shear]
    else:
        moduli = [float(constants[name]) for name in ("E1", "E2")]
        moduli.append(float(constants.get("E3") or moduli[0]))
        ratios = [float(constants.get(name) or 0.0) for name in ("nu12", "nu13", "nu23")]
        shears = [float(constants.get(name) or constants["G12"]) for name in ("G23", "G13", "G12")]
    compliance = np.diag(1 / np.array([*moduli, *shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def turned(stiffness: Float, degrees: float) -> Float:
    """Rotate a stiffness C' by `degrees` from x1 to x2: C_ijkl = R_ip R_jq R_kr R_ls C'_pqrs."""
    voigt = VOIGT[len(stiffness)]
    turn = _turn(degrees, len(voigt))
    tensor = stiffness[voigt[:, :, None, None], voigt[None, None]]
    tensor = np.einsum("ip,jq,kr,ls,pqrs->ijkl", turn, turn, turn, turn, tensor, optimize=True)
    i, j = np.transpose([np.argwhere(voigt == number)[0] for number in range(len(stiffness))])
    return np.asarray(tensor[i[:, None], j[:, None], i[None], j[None]])


def _turn(degrees: float, axes: int) -> Float:
    """Compute the matrix R (axes, axes) of the rotation by `degrees` from x1 to x2."""
    angle, turn = np.radians(degrees), np.eye(axes)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
