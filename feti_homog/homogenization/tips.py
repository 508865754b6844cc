"""The tips of debonded arcs in the cells that the program meshes: where they are, and how fine the mesh is there."""

from __future__ import annotations

from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.case.phase_names import COATING, MATRIX
from feti_homog.interface.tips import debonded_arcs
from feti_homog.mesh.sizes.element_estimate import ElementEstimate, ratio_at_a_tip

# The stress at a tip is singular, so that the energy errs by about the size of the elements there, elsewhere by
# h^(2 order). At this share of a balance the tips err no more than the rest (`scripts/measure_tips.py`).
TIP_SHARE = 0.5
# Where one mesh has the tips of many openings, of which one at a time is there: triangles that all tips together add by
# default / those of the mesh without them, at most.
TIP_TRIANGLES = 2.0
# Size at tips / width of the cell by default, at least.
LEAST_SIZE = 1e-5


def on_interface(case: Case, interface: InterfaceSection, fibres: int) -> dict[int, list[float]]:
    """Directions in [0, 360) of the tips of its arcs on so many fibres, at all their openings, by the fibre's number
    from 0."""
    return debonded_arcs.tips(interface.debonded, case.section.openings, fibres)


def marks(case: Case, fibres: int) -> dict[int, list[float]]:
    """Directions of all tips on so many fibres, by the number of their curve (`BareOutline.of`)."""
    found: dict[int, set[float]] = {}
    for interface in case.interfaces:
        is_within = interface.between is not None and {COATING, MATRIX} & set(interface.between) == {COATING}
        for fibre, own in on_interface(case, interface, fibres).items():
            found.setdefault(~fibre if is_within else fibre, set()).update(own)
    return {curve: sorted(found[curve]) for curve in sorted(found)}


def size(case: Case, estimate: ElementEstimate) -> float | None:
    """Element size at tips / width of the cell, None for that of the interface: what the case says, or by default

        h_t = 2^refine R (h / R)^(2 order) / 2,  h = interface_size / 2^refine,

    with R the mean radius / width; but with several openings not so small that their tips took more than TIP_TRIANGLES.
    Along paths tips move, and only what the case says counts; so it is with envelopes, for they begin paths.
    """
    cell, tips = case.cell, sum(len(own) for own in marks(case, estimate.fibres).values())
    if cell.tip_size is not None or case.section.breaks or not tips:
        return cell.tip_size
    radius, around = estimate.mean_radius, estimate.interface_size
    fine = around / 2**cell.refine
    balanced: float = TIP_SHARE * 2**cell.refine * radius * (fine / radius) ** (2 * cell.order)
    wanted = max(balanced, LEAST_SIZE)
    if len(case.section.openings) > 1:
        share = TIP_TRIANGLES * estimate.triangles / tips
        wanted = max(wanted, around / ratio_at_a_tip(share))
    return min(around, wanted)
