"""Stress from strain in each phase: the constants of the case, taken through the three-dimensional compliance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.typing import Float

PLANE = [0, 1, 5]  # of the order [11, 22, 33, 23, 13, 12]


def plane_stiffnesses(case: Mapping[str, Any], phases: Sequence[str]) -> Float:
    """(phases, 3, 3) matrices that turn [E11, E22, gamma12] into [S11, S22, S12].

    Raises:
        CaseError: a phase of the mesh has no material in the case.
    """
    return np.stack([_plane_stiffness(_constants(case, phase), case["analysis"]["plane"]) for phase in phases])


def out_of_plane(case: Mapping[str, Any], phases: Sequence[str]) -> Float:
    """(phases, 2, 3) matrices that turn [S11, S22, S12] into [S33, E33]; NaN where the constants do not say it.

    Raises:
        CaseError: a phase of the mesh has no material in the case.
    """
    return np.stack([_out_of_plane(_constants(case, phase), case["analysis"]["plane"]) for phase in phases])


def _constants(case: Mapping[str, Any], phase: str) -> Mapping[str, Any]:
    materials = case["material"]
    constants = materials.get(phase, materials.get(phase.partition(":")[0]))
    if not isinstance(constants, Mapping):
        raise CaseError(f"result.json: its case has no material for the phase {phase} of result.h5")
    found: Mapping[str, Any] = constants
    return found


def _out_of_plane(constants: Mapping[str, Any], plane: str) -> Float:
    """E33 = s13 S11' + s23 S22' + s33 S33 with the stresses in the material axes; one of S33 and E33 is 0."""
    wanted = {"young": ("poisson",), "E1": ("nu13", "nu23", *(["E3"] if plane == "strain" else []))}
    form = next((name for name in wanted if name in constants), None)
    if form is None or any(constants.get(name) is None for name in wanted[form]):
        rule = np.full(3, np.nan)
    else:
        compliance = _compliance(constants)
        share = compliance[2, 2] if plane == "strain" else -1.0
        angle = np.radians(float(constants.get("angle", 0.0)))
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        # S11' = a S a with a the first axis; [S11, S22, S12] has S12 once.
        rule = -np.array([[a[0] ** 2, a[1] ** 2, 2 * a[0] * a[1]] for a in axes]).T @ compliance[2, :2] / share
    nothing = np.zeros(3)
    return np.stack([rule, nothing] if plane == "strain" else [nothing, rule])


def _plane_stiffness(constants: Mapping[str, Any], plane: str) -> Float:
    """In plane stress S33 = S13 = S23 = 0; in plane strain E33 = gamma13 = gamma23 = 0."""
    if "stiffness" in constants:
        given = np.array(constants["stiffness"], float)
        return np.asarray((given + given.T) / 2)
    compliance = _compliance(constants)
    if plane == "stress":
        own = np.linalg.inv(compliance[np.ix_(PLANE, PLANE)])
    else:
        own = np.linalg.inv(compliance)[np.ix_(PLANE, PLANE)]
    return _turned(np.asarray(own, float), float(constants.get("angle", 0.0)))


def _compliance(constants: Mapping[str, Any]) -> Float:
    """(6, 6) in the material axes; out of plane constants that plane stress does not need are any that are stable."""
    if "young" in constants:
        e, nu = float(constants["young"]), float(constants["poisson"])
        moduli, ratios, shear = [e, e, e], [nu, nu, nu], e / (2 * (1 + nu))
    else:
        moduli = [float(constants[name] or 1.0) for name in ("E1", "E2", "E3")] if constants.get("E3") else []
        moduli = moduli or [float(constants["E1"]), float(constants["E2"]), float(constants["E1"])]
        ratios = [float(constants.get(name) or 0.0) for name in ("nu12", "nu13", "nu23")]
        shear = float(constants["G12"])
    compliance = np.diag([1 / moduli[0], 1 / moduli[1], 1 / moduli[2], 1 / shear, 1 / shear, 1 / shear])
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def _turned(stiffness: Float, degrees: float) -> Float:
    """C_ijkl = R_ip R_jq R_kr R_ls C'_pqrs in axes x1, x2 of a material whose axis 1 is `degrees` from x1 to x2."""
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    voigt = np.array([[0, 2], [2, 1]])
    tensor = stiffness[voigt[:, :, None, None], voigt[None, None]]
    tensor = np.einsum("ip,jq,kr,ls,pqrs->ijkl", turn, turn, turn, turn, tensor)
    i, j = np.array([0, 1, 0]), np.array([0, 1, 1])
    return np.asarray(tensor[i[:, None], j[:, None], i[None], j[None]])
