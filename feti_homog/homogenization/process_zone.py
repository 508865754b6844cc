"""Whether elements resolve the length along which bonds break by energy."""

from __future__ import annotations

import math

import numpy as np

from feti_homog.case.case import Case
from feti_homog.homogenization.bonds import has_process_zone
from feti_homog.materials.bounds import engineering_moduli
from feti_homog.materials.laws import plane_stiffness
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.interface_edges import interface_edges

# Largest element on an interface / length of the process zone. With 0.54 of it the stresses of the square cell of
# tests/parallel/test_energy.py are within 1.4 % of those with elements a quarter as long, with 1.1 of it within 4.3 %.
RESOLVED = 0.5
LARGEST_REFINE, SMALLEST_SIZE = 8, 1e-5


def longest_edge(mesh: CoarseMesh) -> float:
    """Return the longest edge between phases; 0 if there is none."""
    ends = mesh.points[interface_edges(mesh)]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0))


def process_zone(case: Case) -> float | None:
    """Return the length E' G_Ic / sigma_c^2 of bonds that break by energy, sigma_c = sqrt(2 k_n G_Ic), of several
    interfaces the least; None of others.

    E' is Young's modulus of the plane state, E / (1 - nu^2) in plane strain, of the most compliant phase, which the
    matrix is in general, and of its most compliant axis.
    """
    lengths = [1 / (2 * bond.normal_stiffness) for bond in case.interfaces if bond.toughness and bond.normal_stiffness]
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
    length = process_zone(case)
    if length is None or edge / 2**case.cell.refine <= RESOLVED * length:
        return []
    found = f"elements on the interface are up to {edge / 2**case.cell.refine:.3g} long"
    if case.cell.refine:
        found += f" after refine = {case.cell.refine}"
    wanted = f"the process zone is E' G_Ic / sigma_c^2 = {length:.3g} long, elements should be at most half of that"
    law = f'[interface] criterion = "{case.interfaces[0].criterion}"'
    return [f"{law}: {found}; {wanted}: set {_remedies(case, width, edge, length)}"]


def _remedies(case: Case, width: float, edge: float, length: float) -> str:
    """Keys that would resolve the process zone."""
    refine = math.ceil(math.log2(edge / (RESOLVED * length)))
    # Rounded down to two digits.
    size = RESOLVED * length * 2**case.cell.refine / width
    digit = 10.0 ** (math.floor(math.log10(size)) - 1)
    size = math.floor(size / digit + 1e-9) * digit
    finer = [f"refine = {refine}"] if refine <= LARGEST_REFINE else []
    if case.cell.has_own_mesh:
        return " or ".join([*finer, "a finer mesh"])
    if size >= SMALLEST_SIZE:
        finer.insert(0, f"interface_size = {size:.2g} (or mesh_size, of all elements)")
    return ", or ".join(finer) or "interface_size and refine"
