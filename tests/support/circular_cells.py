"""Cells of circular fibres as input of the geometry."""

from feti_homog.case.cell_section import Cell


def cell(geometry="random", fraction=0.4, size=0.05, fibres=16, gap=0.06, seed=0, spread=0.0, **lengths):
    """Return the section [cell], with a size of its own if `lengths` give one."""
    return Cell(
        geometry=geometry,
        fibre_fraction=fraction,
        mesh_size=size,
        fibres=fibres,
        min_gap=gap,
        seed=seed,
        radius_spread=spread,
        **lengths,
    )
