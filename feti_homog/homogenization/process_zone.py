"""Length along which bonds break by energy, which elements must resolve, and other demands of a cohesive law."""

from __future__ import annotations

import math

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection, interface_label
from feti_homog.homogenization.bonds import bond_law, has_process_zone, has_softening
from feti_homog.materials.constants import engineering_moduli
from feti_homog.materials.laws import plane_stiffness
from feti_homog.mesh.coarse_mesh import CoarseMesh, interface_edges

# Largest element on an interface / length of the process zone. With 0.54 of it the stresses of the square cell of
# tests/parallel/test_energy.py are within 1.4 % of those with elements a quarter as long, with 1.1 of it within 4.3 %.
RESOLVED = 0.5
# The same of cohesive laws, whose tractions fall along it.
RESOLVED_SOFTENING = 1 / 3
# Relative difference of stiffness ratios, or of teeth, that is none.
SAME_RATIO = 1e-3
LARGEST_REFINE, SMALLEST_SIZE = 8, 1e-5


def longest_edge(mesh: CoarseMesh) -> float:
    """Return the longest edge between phases; 0 if there is none."""
    ends = mesh.points[interface_edges(mesh)]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0))


def process_zone(case: Case) -> float | None:
    """Return the length E' G_Ic / sigma_c^2 of bonds that break by energy.

    sigma_c = sqrt(2 k_n G_Ic) or of a cohesive law the strength, in the shorter of its pure modes; of several
    interfaces the least; None of others.

    E' is Young's modulus of the plane state, E / (1 - nu^2) in plane strain, of the most compliant phase, which the
    matrix is in general, and of its most compliant axis.
    """
    lengths = [1 / (2 * bond.normal_stiffness) for bond in case.interfaces if bond.toughness and bond.normal_stiffness]
    for bond in case.interfaces:
        pure = (bond.normal_toughness, bond.normal_strength), (bond.tangential_toughness, bond.tangential_strength)
        lengths += [toughness / strength**2 for toughness, strength in pure if toughness and strength]
    if not has_process_zone(case) or not lengths:
        return None
    moduli = [engineering_moduli(plane_stiffness(m, case.analysis.plane)) for m in case.materials.values()]
    return min(min(m.E1, m.E2) for m in moduli) * min(lengths)


def warnings(case: Case, width: float, edge: float) -> list[str]:
    """Return a line if elements on the interface do not resolve the process zone, and what would.

    Args:
        width: of the cell.
        edge: `longest_edge` of the coarse mesh, which `refine` halves.
    """
    length, softens = process_zone(case), has_softening(case)
    resolved = RESOLVED_SOFTENING if softens else RESOLVED
    others = _of_paths(case)
    if length is None or edge / 2**case.cell.refine <= resolved * length:
        return others
    found = f"elements on the interface are up to {edge / 2**case.cell.refine:.3g} long"
    if case.cell.refine:
        found += f" after refine = {case.cell.refine}"
    symbols, share = ("E' G / N^2", "a third") if softens else ("E' G_Ic / sigma_c^2", "half")
    strength = "" if softens else f" for sigma_c = sqrt(2 k_n G_Ic) = {_opening_strength(case):.3g}"
    wanted = f"the process zone is {symbols} = {length:.3g} long{strength}, elements should be at most {share} of that"
    law = f'[interface] law = "{case.interfaces[0].criterion}"'
    return [f"{law}: {found}; {wanted}: set {_remedies(case, width, edge, resolved * length)}", *others]


def _opening_strength(case: Case) -> float:
    """Return the traction at which the bonds of the shortest process zone break in pure opening, by energy."""
    pairs = [(bond.normal_stiffness or 0.0, bond.toughness or 0.0) for bond in case.interfaces]
    stiffness, toughness = max(pair for pair in pairs if all(pair))
    return math.sqrt(2.0 * stiffness * toughness)


def _of_paths(case: Case) -> list[str]:
    """Return the warnings on a cohesive law under changing modes.

    One if the energy that it takes in changing modes depends on their order, and one if its teeth overshoot.
    """
    if not has_softening(case):
        return []
    lines, law = [], bond_law(case.interfaces, np.zeros(0, np.int64))
    for number, bond in enumerate(case.interfaces):
        strengths, toughnesses = _pure(bond, "strength"), _pure(bond, "toughness")
        stiffnesses = _pure(bond, "stiffness")
        label = interface_label(number, len(case.interfaces))
        ratio, wanted = stiffnesses[1] / stiffnesses[0], toughnesses[0] / toughnesses[1]
        wanted *= (strengths[1] / strengths[0]) ** 2
        if abs(ratio / wanted - 1.0) > SAME_RATIO:
            lines.append(
                f"[{label}] tangential_stiffness / normal_stiffness = {ratio:.4g}: other than (normal_toughness / "
                f"tangential_toughness) (tangential_strength / normal_strength)^2 = {wanted:.4g}: the energy of bonds "
                "whose mode changes depends on the way"
            )
    excess, tolerance = law.overshoot, case.interfaces[0].softening_tolerance
    if excess > tolerance * (1.0 + SAME_RATIO):
        lines.append(
            f"[interface] teeth = {case.interfaces[0].teeth}: the first exceeds the peak traction by {excess:.1%}, "
            f"softening_tolerance is {tolerance:.1%}; without teeth the program chooses their number"
        )
    return lines


def _pure(bond: InterfaceSection, kind: str) -> tuple[float, float]:
    """Return the numbers of the pure modes."""
    normal, tangential = (getattr(bond, f"{mode}_{kind}") for mode in ("normal", "tangential"))
    return normal, tangential


def _remedies(case: Case, width: float, edge: float, wanted: float) -> str:
    """Keys that would make elements as short as wanted."""
    refine = math.ceil(math.log2(edge / wanted))
    # Rounded down to two digits.
    size = wanted * 2**case.cell.refine / width
    digit = 10.0 ** (math.floor(math.log10(size)) - 1)
    size = math.floor(size / digit + 1e-9) * digit
    finer = [f"refine = {refine}"] if refine <= LARGEST_REFINE else []
    if case.cell.has_own_mesh:
        return " or ".join([*finer, "a finer mesh"])
    if size >= SMALLEST_SIZE:
        finer.insert(0, f"interface_size = {size:.2g} (or mesh_size, of all elements)")
    return ", or ".join(finer) or "interface_size and refine"
