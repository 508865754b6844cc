"""Choose the problems on the plane mesh, with their phase stiffnesses, springs and bond strengths.

In generalized plane strain the plane problem has the loads e = [E11, E22, gamma12, E33, T] with a temperature change T,
and the stiffness A = N^T C N with N e = [E11, E22, gamma12, E33] - alpha T.  So A e is [S11, S22, S12, S33] followed by
the conjugate of T, and 1/2 e.A e is the stored energy.
"""

import math
from dataclasses import replace

import numpy as np

from feti_homog.case import Case, bond_laws
from feti_homog.fem import AXIAL, CONDUCTION, GENERALIZED, PLANE, Problem
from feti_homog.feti.decomposition import jump_operator
from feti_homog.materials import laws, voigt
from feti_homog.typing import Float

IN_PLANE, AXIAL_SHEAR, GRADIENT = [0, 1, 5, 2], [4, 3], [4, 3, 2]
"""Indices among the six strains in space: of the plane problem with E33, of axial shear, of conduction."""


def problems(case: Case) -> tuple[Problem, ...]:
    """Return the plane problem and, in generalized plane strain, the axial problem; or only conduction.

    A temperature is a load of the plane problem if all phases have expansions.
    """
    state = voigt.PLANE_STATES[case.analysis.plane]
    if not state.is_spatial or state.is_scalar:
        return (CONDUCTION if state.is_scalar else PLANE,)
    if any(laws.expansion(material) is None for material in case.materials.values()):
        return replace(GENERALIZED, loads=GENERALIZED.loads[:4]), AXIAL
    return GENERALIZED, AXIAL


def law(case: Case, phase: str, problem: Problem) -> Float:
    """Return the phase stiffness or conductivity A (v, v) for the loads of a problem."""
    material = case.material_of(phase)
    if problem == CONDUCTION:
        return laws.conductivity(material)
    if problem == PLANE:
        return laws.plane_stiffness(material, case.analysis.plane)
    C = laws.spatial_stiffness(material)
    if problem == AXIAL:
        return C[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)]
    C, alpha = C[np.ix_(IN_PLANE, IN_PLANE)], laws.expansion(material)
    if problem != GENERALIZED or alpha is None:
        return C
    N = np.column_stack([np.eye(4), -alpha[IN_PLANE]])
    return np.asarray(N.T @ C @ N)


def law_derivatives(case: Case, phase: str, dC: Float, expansion: Float) -> tuple[Float, ...]:
    """Differentiate `law` with respect to a phase constant, in each of the `problems`: one or two derivatives (v, v).

    `dC` is the derivative of the phase stiffness, (3, 3) or (6, 6), or conductivity; `expansion` (6,) is d alpha.
    """
    problem = problems(case)[0]
    if problem in (PLANE, CONDUCTION):
        return (dC,)
    axial, in_plane = dC[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)], dC[np.ix_(IN_PLANE, IN_PLANE)]
    material = case.material_of(phase)
    alpha = laws.expansion(material)
    if problem != GENERALIZED or alpha is None:
        return in_plane, axial
    C = laws.spatial_stiffness(material)[np.ix_(IN_PLANE, IN_PLANE)]
    N, dN = np.column_stack([np.eye(4), -alpha[IN_PLANE]]), np.zeros((4, 5))
    dN[:, 4] = -expansion[IN_PLANE]
    mixed = N.T @ C @ dN
    return N.T @ in_plane @ N + mixed + mixed.T, axial


def secants(plane: Float, *axial: Float) -> dict[str, Float]:
    """Assemble the effective `stiffness` and `thermal_stress` from stresses under unit loads.

    Arguments are (v, v) in the plane problem and (2, 2) in the axial problem.  The stiffness is (3, 3) or, with an
    axial problem, (6, 6).  If a temperature is a load, the thermal stress (6,) is the stress under a unit temperature.
    """
    if not axial:
        return {"stiffness": plane}
    C = np.zeros((6, 6))
    C[np.ix_(IN_PLANE, IN_PLANE)] = plane[:4, :4]
    C[np.ix_(AXIAL_SHEAR, AXIAL_SHEAR)] = axial[0]
    heat = {"thermal_stress": spatial_vector(plane[:, 4], None)} if len(plane) > 4 else {}
    return {"stiffness": C} | heat


def components(plane: Float, *axial: Float) -> Float:
    """Join the strain or stress components of the problems: (3,), or (6,) with an axial problem."""
    return spatial_vector(plane, *axial) if axial else plane


def spatial_vector(plane: Float | None, axial: Float | None) -> Float:
    """Join components of the plane and the axial problem (or conduction) to a vector (6,); None counts as zero."""
    vector = np.zeros(6)
    if plane is not None:
        vector[IN_PLANE] = plane[:4]
    if axial is not None:
        vector[GRADIENT[: len(axial)]] = axial
    return vector


def springs(case: Case, problem: Problem = PLANE) -> jump_operator.InterfaceSprings:
    """Return the springs of a problem at all interfaces; by default axial springs have the tangential stiffness.

    The springs of conduction are conductances.  Missing stiffnesses are infinite.
    """
    bonds = case.interfaces
    along = [(bond.conductance or bond.axial_stiffness or bond.tangential_stiffness or math.inf,) for bond in bonds]
    around = [(bond.normal_stiffness or math.inf, bond.tangential_stiffness or math.inf) for bond in bonds]
    return jump_operator.InterfaceSprings(tuple(along if problem.components == 1 else around), has_softening(case))


def has_softening(case: Case) -> bool:
    """Return whether damage in the bond law changes the compliance of bonds; false without an interface."""
    return case.interface is not None and bond_laws.LAWS[case.interface.criterion].softens


def has_springs(case: Case) -> bool:
    """Return whether any interface has a finite stiffness or conductance."""
    stiffnesses = (*springs(case).stiffness, *springs(case, AXIAL).stiffness)
    return any(math.isfinite(stiffness) for row in stiffnesses for stiffness in row)


def strength_factors(case: Case, fibres: int) -> Float:
    """Return the ratios (fibres,) of the bond strength of each fibre to the strength in the case.

    A ratio is 1 or, with scatter, (-ln(1 - U))^(1/m) / Gamma(1 + 1/m) with uniform U (Weibull's distribution with
    modulus m, mean 1), times the column `strength` in a fibre table.  In any cell, fibre N takes the N-th random
    number.
    """
    factors = np.ones(fibres)
    scatter = case.interface.scatter if case.interface else None
    if scatter is not None:
        # A separate random stream, because the arrangement takes other numbers from the same seed.
        uniform = np.random.default_rng(np.random.SeedSequence(scatter.seed, spawn_key=(1,))).random(fibres)
        factors = (-np.log1p(-uniform)) ** (1.0 / scatter.shape) / math.gamma(1.0 + 1.0 / scatter.shape)
    table = case.cell.table
    if table is None:
        return factors
    from feti_homog.microstructure import periodic_table  # imports the windows of tables

    return factors * table.strength[periodic_table.fibre_rows(table, case.cell.window)]
