"""The problems of a case on the plane mesh, the stiffness of its phases in them, its springs and laws of bonds.

In generalized plane strain the loads of the plane problem are e = [E11, E22, gamma12, E33, T], T a change of
temperature, and A = N^T C N with N e = [E11, E22, gamma12, E33] - alpha T.  So A e is [S11, S22, S12, S33] and the
conjugate of T, and 1/2 e.A e the stored energy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from feti_homog.case import bond_laws, cell_sizes
from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.fem.problem import AXIAL, GENERALIZED, PLANE, Problem
from feti_homog.feti.decomposition.jump_operator import InterfaceSprings
from feti_homog.interface.laws.bond_law import BondLaw, law_class
from feti_homog.materials.derivatives import LawChange
from feti_homog.materials.laws import expansion, plane_stiffness, spatial_stiffness
from feti_homog.materials.voigt import PLANE_STATES
from feti_homog.typing import Float, Int

IN_PLANE, AXIAL_SHEAR = [0, 1, 5, 2], [4, 3]
"""Places of the strains of the plane problem, with E33, and of the axial problem in the order of space."""
# Power of a fibre's factor for keys of these endings: laws remain similar, for all openings grow by the factor too, and
# the length of the process zone stays.
POWERS = {"strength": 1, "toughness": 2}


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
    """(3,) or, with an axial problem, (6,) components of a strain or stress from its parts in each problem."""
    return spatial_vector(plane, *axial) if axial else plane


def spatial_vector(plane: Float | None, axial: Float | None) -> Float:
    """(6,) from numbers [11, 22, 12, 33, ...] of the plane problem and [13, 23] of the axial one; None is zero."""
    vector = np.zeros(6)
    if plane is not None:
        vector[IN_PLANE] = plane[:4]
    if axial is not None:
        vector[AXIAL_SHEAR] = axial
    return vector


def springs(case: Case) -> InterfaceSprings:
    """Return normal and tangential springs of the problem in the plane."""
    stiffness = ((bond.normal_stiffness or math.inf, bond.tangential_stiffness or math.inf) for bond in case.interfaces)
    return InterfaceSprings(tuple(stiffness), has_softening(case))


def axial_springs(case: Case) -> InterfaceSprings:
    """Return the springs of the problem along the fibres; without a stiffness of their own as around the fibre."""
    stiffness = ((bond.axial_stiffness or bond.tangential_stiffness or math.inf,) for bond in case.interfaces)
    return InterfaceSprings(tuple(stiffness), has_softening(case))


def has_softening(case: Case) -> bool:
    """Return whether the law of the bonds changes their compliance."""
    return case.interface is not None and bond_laws.LAWS[case.interface.criterion].softens


def has_springs(case: Case) -> bool:
    """Return whether any bond gives way."""
    stiffnesses = (*springs(case).stiffness, *axial_springs(case).stiffness)
    return any(math.isfinite(stiffness) for row in stiffnesses for stiffness in row)


def strength_factors(case: Case, fibres: int) -> Float:
    """(fibres,) strength of the bonds of each fibre / strength in the case.

    f = (-ln(1 - U))^(1/m) / Gamma(1 + 1/m) with uniform U, Weibull's distribution of modulus m and mean 1, times the
    column `strength` of a table of fibres.  Fibre N takes the N-th number of the generator in any cell.
    """
    factors, scatter = np.ones(fibres), case.interface.scatter if case.interface else None
    if scatter is not None:
        # A separate stream: the arrangement takes other numbers of the same seed.
        uniform = np.random.default_rng(np.random.SeedSequence(scatter.seed, spawn_key=(1,))).random(fibres)
        factors = (-np.log1p(-uniform)) ** (1.0 / scatter.shape) / math.gamma(1.0 + 1.0 / scatter.shape)
    table = case.cell.table
    if table is None:
        return factors
    from feti_homog.microstructure.periodic_table import fibre_rows  # with windows of tables

    return factors * table.strength[fibre_rows(table, case.cell.window)]


@dataclass(frozen=True)
class SectionValues:
    """Values of the keys of sections [interface] at nodes (k,) of the sections `pair` (k,).

    `factor` (k,), by the fibre of each node, multiplies strengths, and squared toughnesses.
    """

    bonds: Sequence[InterfaceSection]
    pair: Int
    factor: float | Float

    def __call__(self, key: str, *more: str) -> float | Float:
        """Return the value of a key, or the next key with a value, at all nodes or (k,) at each; else inf."""
        sections = self.everywhere(key, *more)
        values = float(sections[0]) if len(sections) == 1 else sections[self.pair]
        power = POWERS.get(key.rpartition("_")[2], 0)
        return values * self.factor**power if power else values

    def everywhere(self, key: str, *more: str) -> Float:
        """(s,) values of all sections, for the factor 1."""
        names = (key, *more)
        values = [next((v for n in names if (v := getattr(bond, n)) is not None), math.inf) for bond in self.bonds]
        return np.array(values or [math.inf], float)

    def common(self, key: str) -> Any:
        """Return the common value of all sections."""
        return getattr(self.bonds[0], key)


def bond_law(bonds: Sequence[InterfaceSection], pair: Int, factor: float | Float = 1.0) -> BondLaw:
    """Return the law of the bonds at nodes (k,), arguments as in `SectionValues`; without sections no bond breaks."""
    name = bonds[0].criterion if bonds else bond_laws.DEFAULT
    return law_class(name).of_keys(SectionValues(bonds, pair, factor))


def has_process_zone(case: Case) -> bool:
    """Return whether elements must resolve the length along which the bonds of a case break."""
    return case.interface is not None and bond_laws.LAWS[case.interface.criterion].has_process_zone
