"""The problems that a case asks for on the plane mesh, and the stiffness of its phases in them.

In generalized plane strain the loads of the plane problem are e = [E11, E22, gamma12, E33, T], T a change of
temperature, and A = N^T C N with N e = [E11, E22, gamma12, E33] - alpha T.  So A e is [S11, S22, S12, S33] and what
works on T, and 1/2 e.A e the energy that is stored.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.case import cell_sizes
from feti_homog.case.case import Case
from feti_homog.fem.problem import AXIAL, GENERALIZED, PLANE, Problem
from feti_homog.materials.derivatives import LawChange
from feti_homog.materials.laws import expansion, plane_stiffness, spatial_stiffness
from feti_homog.materials.voigt import PLANE_STATES
from feti_homog.typing import Float

IN_PLANE, AXIAL_SHEAR = [0, 1, 5, 2], [4, 3]
"""Where the strains of the plane problem, E33 among them, and of the axial one stand in the order of space."""


def problems(case: Case) -> tuple[Problem, ...]:
    """Return the problem of the plane and, if strains along the fibres are loads, the axial one.

    A temperature is a load if the phases have thermal expansions.
    """
    if not PLANE_STATES[case.analysis.plane].is_spatial:
        return (PLANE,)
    if any(expansion(material) is None for material in case.materials.values()):
        return replace(GENERALIZED, loads=GENERALIZED.loads[:4]), AXIAL
    return GENERALIZED, AXIAL


def plane_problem(case: Case) -> Problem:
    """Return the problem of the displacements in the plane."""
    return problems(case)[0]


def plane_law(case: Case, phase: str) -> Float:
    """(v, v) stiffness A of a phase in the plane problem."""
    material, problem = case.material_of(phase), plane_problem(case)
    if problem == PLANE:
        return plane_stiffness(material, case.analysis.plane)
    C = spatial_stiffness(material)[np.ix_(IN_PLANE, IN_PLANE)]
    alpha = expansion(material)
    if problem != GENERALIZED or alpha is None:
        return C
    N = np.column_stack([np.eye(4), -alpha[IN_PLANE]])
    return np.asarray(N.T @ C @ N)


def is_mixed(case: Case, phase: str) -> bool:
    """Return whether the elements of a phase have a bubble and a pressure of their own in the plane problem."""
    return cell_sizes.is_mixed(case.cell.order, case.material_of(phase), case.analysis.plane)


def axial_law(case: Case, phase: str) -> Float:
    """(2, 2) stiffness of a phase in the axial problem."""
    return spatial_stiffness(case.material_of(phase))[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)]


def law_derivatives(case: Case, phase: str, change: LawChange) -> tuple[Float, ...]:
    """Return the derivatives of `plane_law` and, if there is an axial problem, of `axial_law`."""
    problem, dC = plane_problem(case), change.stiffness
    if problem == PLANE:
        return (dC,)
    axial, dC = dC[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)], dC[np.ix_(IN_PLANE, IN_PLANE)]
    material = case.material_of(phase)
    alpha = expansion(material)
    if problem != GENERALIZED or alpha is None:
        return dC, axial
    C = spatial_stiffness(material)[np.ix_(IN_PLANE, IN_PLANE)]
    N, dN = np.column_stack([np.eye(4), -alpha[IN_PLANE]]), np.zeros((4, 5))
    dN[:, 4] = -change.expansion[IN_PLANE]
    mixed = N.T @ C @ dN
    return N.T @ dC @ N + mixed + mixed.T, axial


def secants(plane: Float, *axial: Float) -> dict[str, Float]:
    """Return `stiffness`, (3, 3) or with an axial problem (6, 6), and if a temperature is a load `thermal_stress` (6,).

    They follow from stresses under unit loads, (v, v) of the plane problem and (2, 2) of the axial one; the thermal
    stress is that under a unit of it.
    """
    if not axial:
        return {"stiffness": plane}
    C, place = np.zeros((6, 6)), np.ix_(IN_PLANE, IN_PLANE)
    C[place], C[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)] = plane[:4, :4], axial[0]
    return {"stiffness": C} | ({"thermal_stress": spatial_vector(plane[:, 4], None)} if len(plane) > 4 else {})


def components(plane: Float, *axial: Float) -> Float:
    """(3,) or, with an axial problem, (6,) components of a strain or stress from those of each problem."""
    return spatial_vector(plane, *axial) if axial else plane


def spatial_vector(plane: Float | None, axial: Float | None) -> Float:
    """(6,) from numbers [11, 22, 12, 33, ...] of the plane problem and [13, 23] of the axial one; None is zero."""
    whole = np.zeros(6)
    if plane is not None:
        whole[IN_PLANE] = plane[:4]
    if axial is not None:
        whole[AXIAL_SHEAR] = axial
    return whole
