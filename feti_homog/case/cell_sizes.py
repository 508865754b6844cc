"""Derive fibre counts, cell width, element order and element size from the section [cell].

In a mix, each fibre phase has a fraction and may have a radius, `radii`.  If the cell gives an accuracy, element order
and size follow from an error estimate.  Mixed elements have a bubble and a pressure inside each element.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import permutations
from math import ceil, fsum, inf, log, pi, sqrt

import numpy as np

from feti_homog.case.cell_section import LATTICES, TOUCHING, Cell
from feti_homog.materials import laws, material_forms, voigt
from feti_homog.microstructure import phase_names
from feti_homog.schema import types, wording

LOCKING_POISSON = 0.49
"""Poisson's ratio above which linear triangles lock."""
# Poisson's ratio above which rounding may fail the checks. At 0.4999999, with fibres a thousandth as stiff
# as the matrix, iterative refinement lowers the error of energies from 2e-4 to 1e-9.
ROUNDING_POISSON = 0.49999999
# Largest Poisson's ratio with derivatives to three digits: their rounding errors grow with 1 / (1 - 2 nu)^2.
DIFFERENTIABLE_POISSON = 0.499999


def is_mixed(order: int, material: material_forms.Material, plane: str) -> bool:
    """Return whether elements of `order` are mixed: quadratic, of isotropic material, in a plane state that locks."""
    return order == 2 and voigt.PLANE_STATES[plane].locks and laws.isotropic_ratio(material) is not None


def warnings(materials: Mapping[str, material_forms.Material], plane: str) -> list[str]:
    """List nearly incompressible phases, for which checks may fail by rounding, one per line."""
    words = "so near to 0.5 that rounding may exceed the tolerance of the checks"
    lines = _above(ROUNDING_POISSON, materials, plane)
    return [f"{line}: {words}; use at most {ROUNDING_POISSON:.10g}" for line in lines]


def derivative_faults(materials: Mapping[str, material_forms.Material], plane: str) -> list[str]:
    """List nearly incompressible phases, for which rounding hides derivatives, one per line."""
    words = f"derivatives (sensitivities, uncertainty) need at most {DIFFERENTIABLE_POISSON}"
    return [f"{line}: {words}" for line in _above(DIFFERENTIABLE_POISSON, materials, plane)]


def remarks(materials: Mapping[str, material_forms.Material], plane: str) -> tuple[str, ...]:
    """List the phases that require quadratic elements, one per line."""
    lines = _above(LOCKING_POISSON, materials, plane)
    return tuple(f"{line}: elements are quadratic, since linear ones lock above {LOCKING_POISSON}" for line in lines)


def _above(limit: float, materials: Mapping[str, material_forms.Material], plane: str) -> list[str]:
    """List the isotropic phases with Poisson's ratio above a limit; none in plane stress and conduction."""
    if not voigt.PLANE_STATES[plane].locks:
        return []
    lines = []
    for phase, material in materials.items():
        name = "poisson" if isinstance(material, material_forms.Isotropic) else "Poisson's ratio"
        if (ratio := laws.isotropic_ratio(material)) and ratio > limit:
            lines.append(f"[material.{wording.toml_key(phase)}] {name} = {ratio}")
    return lines


CHOSEN = ("mesh_size", "interface_size", "tip_size", "refine")
"""Keys that the key `accuracy` determines and excludes."""

# By element order, the error of the coarsest mesh with stiff inclusions / (kappa beta^2), and the factor by which soft
# inclusions raise this error: 1.5 times the largest values that `scripts/measure_accuracy.py` finds.
COARSE_ERROR = {1: 0.12, 2: 0.0075}
SOFT_FACTOR = 6.0
# Upper bound of kappa s in cells with only mixed elements.
MIXED_CONDITION = 33.0
MOST_REFINED = 8


def sized(
    cell: Cell,
    table: Mapping[str, object],
    materials: Mapping[str, material_forms.Material],
    plane: str,
    free_faces: bool,
    faults: list[str],
) -> Cell:
    """Return the cell with mesh size, refinement and element order that follow from its accuracy.

    For an accuracy eps and elements of order p, the coarsest mesh is refined r times, with the least r such that
    `coarse_error` / 4^(p r) <= eps. Unless `table` gives an order, the order with fewer nodes, about p^2 4^r, is taken.
    Without an accuracy, only the order is set: by `table`, else 2 if linear elements lock, else 1. Faults are added to
    `faults`: r above MOST_REFINED, and a locking order. The coarsest elements have half the fibre distance of a square
    lattice with this fibre count, to two digits, and at most half the width; larger ones would hardly save nodes.

    Args:
        table: the [cell] table of the file, with or without an order.
        free_faces: whether the cell has voids, or the case a section [interface].
    """
    locking = _above(LOCKING_POISSON, materials, plane)
    orders = [2] if locking else [1, 2]
    if "order" in table:
        orders = [cell.order]
        if cell.order == 1:
            faults += [f"[cell] order = 1: linear triangles lock: {line}; expected order = 2" for line in locking]
    if cell.accuracy is None:
        return replace(cell, order=orders[0])
    refinements = {}
    for p in orders:
        error = coarse_error(materials, plane, p, free_faces)
        refinements[p] = max(0, ceil(log(error / cell.accuracy, 4**p))) if error > 0 else 0
    order = min(refinements, key=lambda p: (p**2 * 4 ** refinements[p], p))
    if refinements[order] > MOST_REFINED:
        better = "a larger value, or order = 2" if order == 1 else "a larger value"
        reason = f"would need elements split {refinements[order]} times, more than {MOST_REFINED}"
        faults.append(f"[cell] accuracy = {cell.accuracy:g}: {reason}; expected {better}")
    fibres, height = fibres_and_height(cell)
    mesh_size = float(f"{min(1.0, sqrt(height / fibres)) / 2:.2g}")
    return replace(cell, mesh_size=mesh_size, refine=refinements[order], order=order)


def default_size(cell: Cell) -> list[str]:
    """Suggest `accuracy` if elements of the default mesh_size are longer than a table's mean fibre radius; else []."""
    if cell.table is None or cell.table.width is None or cell.accuracy is not None or cell.mesh_size != Cell.mesh_size:
        return []
    ratio = cell.mesh_size / 2**cell.refine * cell.table.width / float(cell.table.radius.mean())
    line = f"[cell] mesh_size = {cell.mesh_size:g}, the default: elements up to {ratio:.2g} mean fibre radii long"
    return [f"{line}; accuracy = 0.01 chooses a mesh by the stiffness error"] if ratio > 1.0 else []


def fibres_and_height(cell: Cell) -> tuple[int, float]:
    """Return fibre count and relative height of a cell without a user mesh; tables need a size, and all rows count."""
    if cell.table is not None:
        assert cell.table.width is not None and cell.table.height is not None
        return len(cell.table.row), cell.table.height / cell.table.width
    lattice = LATTICES.get(cell.geometry)
    return (len(lattice.centres), lattice.height) if lattice else (sum(fibre_counts(cell).values()), 1.0)


def coarse_error(materials: Mapping[str, material_forms.Material], plane: str, order: int, free_faces: bool) -> float:
    """Estimate an upper bound of the relative strain energy error on the coarsest mesh.

    The estimate is C_p kappa max s beta^2 with beta = |lambda - 1| / (lambda + 1) and C_p = COARSE_ERROR of `order` p.
    lambda are the eigenvalues of a phase stiffness relative to the stiffness around the phase, 0 at free faces; s is
    SOFT_FACTOR where lambda < 1 and 1 elsewhere; kappa is the largest condition number of a plane stiffness.
    MIXED_CONDITION bounds kappa in mixed elements, and kappa s if all elements are mixed.
    """
    stiffness = {phase: laws.stiffness_of(material, plane) for phase, material in materials.items()}
    ratios = [
        np.linalg.eigvals(np.linalg.solve(stiffness[outer], stiffness[inner])).real
        for inner, outer in permutations(stiffness, 2)
        if inner != "matrix" and outer in ("matrix", phase_names.COATING)
    ]
    if free_faces:
        ratios.append(np.zeros(1))
    mixed = [is_mixed(order, material, plane) for material in materials.values()]
    scale, conditions = np.sqrt([1.0, 1.0, 2.0]), []  # to orthonormal components, [E11, E22, gamma12 / sqrt(2)]
    for (phase, material), has_pressure in zip(materials.items(), mixed, strict=True):
        is_scalar = voigt.PLANE_STATES[plane].is_scalar
        law = stiffness[phase] if is_scalar else laws.plane_stiffness(material, plane) * np.outer(scale, scale)
        condition = float(np.linalg.cond(law))
        conditions.append(min(condition, MIXED_CONDITION if has_pressure else inf))
    eigenvalues = np.concatenate([np.ones(1), *ratios])
    beta = (eigenvalues - 1) / (eigenvalues + 1)
    factors = max(conditions) * np.where(beta < 0, SOFT_FACTOR, 1.0)
    return COARSE_ERROR[order] * float(np.max(np.minimum(factors, MIXED_CONDITION if all(mixed) else inf) * beta**2))


def fibre_counts(cell: Cell) -> dict[str, int]:
    """Return the fibre count of each phase in a random cell.

    A phase with fraction c_p and radius r_p has the expected number e_p ~ c_p / r_p^2. Each phase gets one fibre, and
    each further fibre goes to the phase with the largest e_p / (2 n_p + 1), where n_p is its number so far: the method
    of Sainte-Lague, which rounds all e_p to whole numbers with the rounded sum of all e_p.
    """
    expected = _expected_counts(cell)
    count = max(len(expected), round(fsum(expected.values())))
    quotients = np.array(list(expected.values()))[:, None] / (2 * np.arange(1, count) + 1)
    phase = np.repeat(np.arange(len(expected)), count - 1)
    further = phase[np.argsort(-quotients.ravel(), kind="stable")[: count - len(expected)]]
    return dict(zip(expected, (1 + np.bincount(further, minlength=len(expected))).tolist(), strict=True))


def _expected_counts(cell: Cell) -> dict[str, float]:
    """Return the expected fibre numbers per phase; their sum is `fibres` or follows from the width."""
    radii = cell.radii or dict.fromkeys(cell.fractions, 1.0)
    per_area = {phase: share / (pi * radii[phase] ** 2) for phase, share in cell.fractions.items()}
    area = cell.fibres / fsum(per_area.values()) if cell.fibres is not None else (cell.width or 1.0) ** 2
    return {phase: area * density for phase, density in per_area.items()}


def fractions_in_words(cell: Cell) -> str:
    """Write the fibre and void fractions of a cell without a file as TOML, such as "fibre_fraction = 0.5"."""
    mix = "" if cell.mix is None else f"mix = {wording.toml_value(dict(cell.mix))}"
    fibres = mix or f"fibre_fraction = {cell.fibre_fraction:g}"
    return f"{fibres}, voids = {cell.voids:g}" if cell.voids else fibres


def mixed_width(cell: Cell) -> float | None:
    """Return the width W of the cell, or None if it follows from `fibre_radius` or is the default.

    With radii and a fibre count, W^2 = sum n_p pi r_p^2 / sum c_p, with symbols as in `fibre_counts`.
    """
    if cell.radii is None or cell.fibres is None:
        return cell.width
    filled = fsum(count * pi * cell.radii[phase] ** 2 for phase, count in fibre_counts(cell).items())
    return sqrt(filled / fsum(cell.fractions.values()))


def size_faults(cell: Cell) -> list[str]:
    """List the faults in fractions, radii, numbers of fibres and element sizes of a cell."""
    faults = list[str]()
    if cell.fibre_fraction is not None:
        spacing = (cell.coating or 0.0) + (cell.min_gap if cell.geometry == "random" else 0.0)
        limit = TOUCHING[cell.geometry] / (1.0 + spacing) ** 2
        if cell.fibre_fraction >= limit:
            reason = "there the coatings touch" if cell.coating else "there the fibres touch"
            if spacing > (cell.coating or 0.0):
                reason = "no circles min_gap apart are denser"
            expected = f"expected less than {wording.limit_in_words(limit, cell.fibre_fraction, 4)}"
            place = f"{expected} for geometry = {wording.toml_value(cell.geometry)}"
            faults.append(f"[cell] fibre_fraction = {cell.fibre_fraction}: {place}: {reason}")
    coarser, largest = "mesh_size", cell.mesh_size
    for name, size in (("interface_size", cell.interface_size), ("tip_size", cell.tip_size)):
        if size is not None and size > largest:
            faults.append(f"[cell] {name} = {size}: expected at most {coarser}, which is {largest}")
        elif size is not None:
            coarser, largest = name, size
    return faults + mix_faults(cell)


def mix_faults(cell: Cell) -> list[str]:
    """List contradictions between fractions, radii and numbers of fibres in a mix."""
    if cell.mix is None:
        return []
    faults, given = [], f"[cell] mix = {wording.toml_value(dict(cell.mix))}"
    if fsum(cell.mix.values()) >= 1:
        faults.append(f"{given}: expected a sum below 1")
    if cell.radii is not None and set(cell.radii) != set(cell.mix):
        expected = f"expected a radius of each of mix: {', '.join(cell.mix)}"
        faults.append(f"[cell] radii = {wording.toml_value(dict(cell.radii))}: {expected}")
    if faults:
        return faults
    expected_counts = _expected_counts(cell)
    if (count := fsum(expected_counts.values())) > types.MOST_FIBRES:
        words = f"expected at most {types.MOST_FIBRES}: give larger radii or a smaller cell"
        return [f"{given}: makes {count:.2g} fibres; {words}"]
    return [
        f"{given}: makes {expected:.2g} fibres of {phase}; expected at least 0.5: give more fibres or a wider cell"
        for phase, expected in expected_counts.items()
        if expected < 1 - expected  # nearer to no fibre than to one
    ]
