"""Cells cut into small tiles."""

from dataclasses import replace
from functools import cache

from feti_homog.mesh.fill.gmsh_mesher import begin
from feti_homog.mesh.tiles.tiling import TilePolicy
from support import generated_meshes
from support.circular_cells import cell

VOIDS = {"voids": 0.05, "void_radius": 0.7}
CELLS = {
    "dense": cell(fibres=36, fraction=0.6, gap=0.04),
    "narrow": cell(fibres=36, fraction=0.7, gap=0.01),
    "dilute": cell(fibres=64, fraction=0.06, gap=0.1),
    "spread": cell(fibres=49, fraction=0.5, spread=0.45),
    "coated": cell(fibres=36, fraction=0.4, gap=0.1, coating=0.05),
    "voids": cell(fibres=36, fraction=0.4, gap=0.1, **VOIDS),
    "coated, voids": cell(fibres=36, fraction=0.4, gap=0.1, coating=0.1, **VOIDS),
    "fine interfaces": cell(fibres=25, fraction=0.5, interface_size=0.01),
    "wide": cell(fibres=30, fraction=0.5, seed=3, size=0.1),
}
SMALL = TilePolicy(least_discs=4, discs=4)


@cache
def noded(name):
    found = generated_meshes.noded(begin(CELLS[name], None, {}, SMALL))
    assert len(found.parts) >= 4
    return replace(found, arrangement=replace(found.arrangement, origin=(3.0, -2.0)))  # as from a table


@cache
def mesh_of(name):
    return generated_meshes.filled(noded(name))
