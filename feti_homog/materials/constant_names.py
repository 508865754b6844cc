"""Names of the constants of a composite in space, each quantity's one name in results, tables, fits and pictures.

Axes 1, 2, 3 of a cell are x1 and x2, across the fibres, and x3, along them.  Axes 1, 2, 3 of a ply, of data sheets and
of cards are x3, x1, x2: names with `axial`, `transverse`, `x1` or `x2` are the same in both.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from feti_homog.materials.voigt import EXPANSIONS, THERMAL_STRESSES

CELL_AXES = "axes of the cell, x3 along the fibres"
MATERIAL_AXES = "Material axes: 1 along the fibres (x3 of the cell), 2 and 3 across (x1, x2)"
ALONG, ACROSS = "along", "across"
MATERIAL_EXPANSIONS = ("expansion_axial", "expansion_x1", "expansion_x2", *EXPANSIONS[3:])
"""Those of strains per unit of temperature in the order of material axes; in that of the cell `voigt` has them."""


@dataclass(frozen=True)
class Constant:
    """A constant along or across the fibres.

    Attributes:
        symbol: in pictures.
        way: `ALONG` or `ACROSS`.
        card: its names on the card of a transversely isotropic material.
    """

    name: str
    symbol: str
    way: str
    card: tuple[str, ...] = ()


ABOUT_FIBRES = {
    each.name: each
    for each in (
        Constant("E_axial", "$E$", ALONG, ("E1",)),
        Constant("E_transverse", "$E$", ACROSS, ("E2", "E3")),
        Constant("nu_axial", "$\\nu$", ALONG, ("nu12", "nu13")),
        Constant("nu_transverse", "$\\nu$", ACROSS, ("nu23",)),
        Constant("G_axial", "$G$", ALONG, ("G12", "G13")),
        Constant("G_transverse", "$G$", ACROSS, ("G23",)),
        Constant("K_transverse", "$K$", ACROSS),
        Constant("expansion_axial", "$\\alpha$", ALONG, ("expansion_axial",)),
        Constant("expansion_transverse", "$\\alpha$", ACROSS, ("expansion_transverse",)),
    )
}
"""Constants of the nearest transversely isotropic material, by name."""
OF_THE_CELL = {
    "E1": "E3", "E2": "E1", "E3": "E2", "G12": "G13", "G13": "G23", "G23": "G12",
    "nu12": "nu31", "nu13": "nu32", "nu23": "nu12",
}  # fmt: skip
"""By the name of a constant in material axes, its name in the axes of the cell."""
FORMER = {
    **{f"expansion.{k + 1}": EXPANSIONS[k] for k in range(3)},
    **{f"thermal_stress.{k + 1}": THERMAL_STRESSES[k] for k in range(3)},
    **{f"alpha{k + 1}": MATERIAL_EXPANSIONS[k] for k in range(3)},
}
"""By names that are no more, those in their place."""
# Components and constants that a ply's axes have the other way: their kind, their way in a cell, and the other way.
_READ_EITHER_WAY = {
    "E1": ("Young's modulus", ACROSS, "E_axial"),
    "E3": ("Young's modulus", ALONG, "E_transverse"),
    "G12": ("shear", ACROSS, "G_axial"),
    "G23": ("shear", ALONG, "G_transverse"),
    "nu12": ("contraction under stress", ACROSS, "nu_axial"),
    "nu13": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "nu23": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "S11": ("stress", ACROSS, "S33"),
    "S33": ("stress", ALONG, "S11, S22"),
    "S12": ("shear", ACROSS, "S13, S23"),
    "S23": ("shear", ALONG, "S12"),
    "E11": ("strain", ACROSS, "E33"),
    "E33": ("strain", ALONG, "E11, E22"),
    "gamma12": ("shear", ACROSS, "gamma13, gamma23"),
    "gamma23": ("shear", ALONG, "gamma12"),
}


def axes_line(names: Iterable[str]) -> str:
    """Return the axes of those names, such as `S12` or `onset_S12`, that could be of a ply; empty without any."""
    bare = dict.fromkeys(name.rpartition(".")[2].rpartition("_")[2] for name in names)
    known = {name: _READ_EITHER_WAY[name] for name in bare if name in _READ_EITHER_WAY}
    return ". ".join(
        f"{name} is {kind} {way} the fibres; {ALONG if way == ACROSS else ACROSS} them {others}"
        for name, (kind, way, others) in known.items()
    )
