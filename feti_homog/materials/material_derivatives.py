"""Differentiate phase laws with respect to their constants, and composite constants with respect to the stiffness.

Stiffnesses are (3, 3) or (6, 6) in Voigt order with engineering shears, as in `laws.stiffness_of`.  Functions without
absolute values are differentiated by an imaginary step, f'(x) = Im f(x + i h) / h, which is exact to rounding (Squire
and Trapp, SIAM Review 40 (1998) 110).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.materials import material_forms
from feti_homog.materials.engineering_constants import constants
from feti_homog.materials.laws import COUPLINGS, conductivity, expansion, known_compliance, stiffness_of
from feti_homog.materials.voigt import IN_PLANE, IN_PLANE_BLOCK, PLANE_STATES, strain_rotation, turned_axes
from feti_homog.typing import Float

STEP = 1e-30  # the square vanishes beside 1 in rounding
ISOTROPIC_COMPLIANCE = {"E_axial": "young", "E_transverse": "young", "nu_axial": "poisson", "nu_transverse": "poisson"}
# Derivative of `strain_rotation` with respect to the angle in degrees, at 0.
TURN = np.zeros((6, 6))
TURN[IN_PLANE_BLOCK] = [[0, 0, 1], [0, 0, -1], [-2, 2, 0]]
TURN[3:5, 3:5] = [[0, -1], [1, 0]]
TURN *= np.pi / 180


@dataclass(frozen=True)
class LawChange:
    """The derivatives of a phase law with respect to one constant.

    Attributes:
        name: key of the constant, with an index in an array, such as `stiffness.C12` or `expansion.3`.
        value: value of the constant.
        stiffness: derivative of the stiffness, (3, 3) or (6, 6); in conduction of the conductivity (3, 3).
        expansion: (6,) derivative of the free strains per unit of temperature.
    """

    name: str
    value: float
    stiffness: Float
    expansion: Float


def law_changes(material: material_forms.Material, plane: str) -> Iterator[LawChange]:
    """Yield a `LawChange` for each constant; expansions only in space.  Raises as `stiffness_of` and `expansion` do."""
    C, none = stiffness_of(material, plane), np.zeros(6)
    if PLANE_STATES[plane].is_scalar:
        yield from (LawChange(name, value, change, none) for name, value, change in _of_conduction(material))
        return
    changes = _of_entries if isinstance(material, material_forms.General) else _of_constants
    for name, value, change in changes(material, plane, C):
        yield LawChange(name, value, change, none)
    free = expansion(material)
    angle = 0.0
    if isinstance(material, material_forms.Orthotropic):
        angle, turn = material.angle, (TURN if len(C) == 6 else TURN[IN_PLANE_BLOCK])
        yield LawChange("angle", angle, turn.T @ C + C @ turn, none if free is None else -TURN @ free)
    if len(C) == 6 and free is not None:
        to_cell = strain_rotation(-angle)[:, :3]
        if isinstance(material.expansion, tuple):
            terms = [(f"expansion.{k + 1}", value, np.eye(3)[k]) for k, value in enumerate(material.expansion)]
        elif material.expansion is not None:
            terms = [("expansion", material.expansion, np.ones(3))]
        else:  # the pair of a transversely isotropic phase
            pair = zip(material_forms.EXPANSION_PAIR, ([0.0, 0.0, 1.0], [1.0, 1.0, 0.0]), strict=True)
            terms = [(name, getattr(material, name), np.array(axes)) for name, axes in pair]
        for name, value, axes in terms:
            yield LawChange(name, value, np.zeros((6, 6)), to_cell @ axes)


def _of_constants(material: Any, plane: str, C: Float) -> Iterator[tuple[str, float, Float]]:
    """Yield name, value and dC = -C dS C (n, n) for each engineering constant.  S is the plane state's compliance."""
    skipped = ("angle", "expansion", "strength", "conductivity", *material_forms.EXPANSION_PAIR)
    names = [field.name for field in fields(material) if field.name not in skipped]
    values = {name: value for name in names if (value := getattr(material, name)) is not None}
    turn = strain_rotation(-getattr(material, "angle", 0.0))
    turn = turn if len(C) == 6 else turn[IN_PLANE_BLOCK]
    for name, value in values.items():
        moved = {other: complex(constant) for other, constant in values.items()}
        varied = replace(material, **moved | {name: complex(value, STEP)})
        if isinstance(varied, material_forms.Isotropic):
            named = {entry: getattr(varied, key) for entry, key in ISOTROPIC_COMPLIANCE.items()}
            varied = material_forms.TransverselyIsotropic(**named, G_axial=varied.young / (2 * (1 + varied.poisson)))
        with np.errstate(invalid="ignore"):  # NaN where constants do not determine the compliance
            changed = _of_plane_state(known_compliance(varied), plane, condensed="strain")
        yield name, value, -C @ turn @ changed @ turn.T @ C


def _of_entries(material: Any, plane: str, C: Float) -> Iterator[tuple[str, float, Float]]:
    """Yield name, value and dC (n, n) for entries ij = ji of a given stiffness except COUPLINGS."""
    matrix = np.array(material.stiffness)
    for i, j in zip(*np.triu_indices(len(matrix)), strict=True):
        if (i, j) in COUPLINGS and len(matrix) == 6:
            continue
        changed = (matrix + matrix.T) / 2 + 0j
        changed[[i, j], [j, i]] += 1j * STEP
        full = changed.imag / STEP if len(matrix) == len(C) else _of_plane_state(changed, plane, condensed="stress")
        yield f"stiffness.C{i + 1}{j + 1}", float((matrix[i, j] + matrix[j, i]) / 2), full


def _of_conduction(material: material_forms.Material) -> Iterator[tuple[str, float, Float]]:
    """Yield name, value and dk (3, 3) in cell axes for each conductivity, and for the angle of a tensor."""
    k = material.conductivity
    if isinstance(k, material_forms.FibreConductivity):
        yield "conductivity.axial", k.axial, np.diag([0.0, 0.0, 1.0])
        yield "conductivity.transverse", k.transverse, np.diag([1.0, 1.0, 0.0])
    elif isinstance(k, float):
        yield "conductivity", k, np.eye(3)
    else:
        angle, tensor = getattr(material, "angle", 0.0), np.array(k)
        R = turned_axes(angle)
        for i, j in zip(*np.triu_indices(3), strict=True):
            unit = np.zeros((3, 3))
            unit[[i, j], [j, i]] = 1.0
            yield f"conductivity.k{i + 1}{j + 1}", float(tensor[i, j] + tensor[j, i]) / 2, R @ unit @ R.T
        if isinstance(material, material_forms.Orthotropic):
            turn = np.pad(TURN[3:5, 3:5], (0, 1))
            yield "angle", angle, turn @ conductivity(material) - conductivity(material) @ turn


def _of_plane_state(M: NDArray[Any], plane: str, *, condensed: str) -> Float:
    """Return the derivative (n, n) of M, a stiffness or compliance with an imaginary step, in a plane state.

    A spatial state takes all of M, a plane state a block; component 33 is eliminated if the state is `condensed`.
    """
    if PLANE_STATES[plane].is_spatial:
        return np.asarray(M.imag / STEP)
    block = M[IN_PLANE_BLOCK]
    if plane == condensed:
        block = block - np.outer(M[IN_PLANE, 2], M[IN_PLANE, 2]) / M[2, 2]
    return np.asarray(block.imag / STEP)


def constant_changes(C: Float, thermal: Float | None, dC: Float, dthermal: Float | None) -> dict[str, float]:
    """Differentiate the table `constants` along dC and dthermal; without both thermal arguments, along dC alone."""
    size = float(np.abs(dC).max() / np.abs(C).max()) or 1.0
    h = STEP / size
    heat = None if thermal is None or dthermal is None else thermal + 1j * h * dthermal
    return {name: float(value.imag / h) for name, value in constants(C + 1j * h * dC, heat).items()}
