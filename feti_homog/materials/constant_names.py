"""Names of the constants of a composite in space, each quantity's one name in results, tables, fits and pictures.

Axes 1, 2, 3 of a cell are x1 and x2, across the fibres, and x3, along them.  Axes 1, 2, 3 of a ply, of data sheets and
of cards are x3, x1, x2: names with `axial`, `transverse`, `x1` or `x2` are the same in both.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from feti_homog.materials.voigt import EXPANSIONS, THERMAL_STRESSES

CELL_AXES = "axes of the cell, x3 along the fibres"
MATERIAL_AXES = "Material axes: 1 along the fibres (x3 of the cell), 2 and 3 across (x1, x2)"
ALONG, ACROSS = "along", "across"
MATERIAL_EXPANSIONS = ("expansion_axial", "expansion_x1", "expansion_x2", *EXPANSIONS[3:])
"""Those of strains per unit of temperature in the order of material axes; in that of the cell `voigt` has them."""


class Constant(NamedTuple):
    """Symbol of a constant, its way, and its names on the card of a transversely isotropic material."""

    symbol: str
    way: str
    card: tuple[str, ...] = ()


ABOUT_FIBRES = {
    "E_axial": Constant("$E$", ALONG, ("E1",)),
    "E_transverse": Constant("$E$", ACROSS, ("E2", "E3")),
    "nu_axial": Constant("$\\nu$", ALONG, ("nu12", "nu13")),
    "nu_transverse": Constant("$\\nu$", ACROSS, ("nu23",)),
    "G_axial": Constant("$G$", ALONG, ("G12", "G13")),
    "G_transverse": Constant("$G$", ACROSS, ("G23",)),
    "K_transverse": Constant("$K$", ACROSS),
    "expansion_axial": Constant("$\\alpha$", ALONG, ("expansion_axial",)),
    "expansion_transverse": Constant("$\\alpha$", ACROSS, ("expansion_transverse",)),
}
"""Constants of the nearest transversely isotropic material, by name."""
OF_THE_CELL = {"E1": "E3", "E2": "E1", "E3": "E2", "G12": "G13", "G13": "G23", "G23": "G12",
               "nu12": "nu31", "nu13": "nu32", "nu23": "nu12"}  # fmt: skip
"""By the name of a constant in material axes, its name in the axes of the cell."""
_PLACES = (("expansion.", EXPANSIONS), ("thermal_stress.", THERMAL_STRESSES), ("alpha", MATERIAL_EXPANSIONS))
FORMER = {f"{former}{k + 1}": names[k] for former, names in _PLACES for k in range(3)}
"""Removed names, each with its replacement."""
# Names that a ply has the other way: what they are, in a cell, and the names of that the other way.
_READ_EITHER_WAY = {
    "E1": ("Young's modulus", ACROSS, "E_axial"), "E3": ("Young's modulus", ALONG, "E_transverse"),
    "G12": ("shear", ACROSS, "G_axial"), "G23": ("shear", ALONG, "G_transverse"),
    "nu12": ("contraction under stress", ACROSS, "nu_axial"),
    "nu13": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "nu23": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "S11": ("stress", ACROSS, "S33"), "S33": ("stress", ALONG, "S11, S22"),
    "S12": ("shear", ACROSS, "S13, S23"), "S23": ("shear", ALONG, "S12"),
    "E11": ("strain", ACROSS, "E33"), "E33": ("strain", ALONG, "E11, E22"),
    "gamma12": ("shear", ACROSS, "gamma13, gamma23"), "gamma23": ("shear", ALONG, "gamma12"),
}  # fmt: skip


def axes_line(names: Iterable[str]) -> str:
    """Return the axes of names, such as `S12` or `onset_S12`, that a ply has the other way; empty without any."""
    bare = dict.fromkeys(name.rpartition("_")[2] for name in names)
    return ". ".join(
        f"{name} is {kind} {way} the fibres; {ALONG if way == ACROSS else ACROSS} them {others}"
        for name, (kind, way, others) in ((name, _READ_EITHER_WAY[name]) for name in bare if name in _READ_EITHER_WAY)
    )
