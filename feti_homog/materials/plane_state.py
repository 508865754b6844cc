"""Plane states: plane strain, plane stress and generalized plane strain, and all in which they differ.

Strains and stresses are [11, 22, 12] in the first two, [11, 22, 33, 23, 13, 12] in the last, with engineering shears.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS, STRESSES


@dataclass(frozen=True)
class PlaneState:
    """A plane state.

    Attributes:
        name: value of [analysis] plane.
        title: its name in words.
        strains, stresses: names of the components, in Voigt order.
        is_sheet: whether S33 vanishes; else E33 does, or is a load.
        is_spatial: whether all six strains are loads, and with them a temperature: then axial shear is a problem of its
            own, the stiffness is (6, 6), and constants, estimates and bounds are those of space.
        numbers: i and j in the names Cij of the entries of strains of the plane.
    """

    name: str
    title: str
    strains: tuple[str, ...] = STRAINS
    stresses: tuple[str, ...] = STRESSES
    is_sheet: bool = False
    is_spatial: bool = False
    numbers: tuple[int, int, int] = (1, 2, 3)

    @property
    def components(self) -> tuple[tuple[str, str], ...]:
        """Names of strain and stress of each component."""
        return tuple(zip(self.strains, self.stresses, strict=True))

    @property
    def normals(self) -> int:
        """Return how many components, the first ones, are normal strains that are loads."""
        return len(self.strains) - (3 if self.is_spatial else 1)


PLANE_STRAIN = PlaneState("strain", "plane strain")
PLANE_STRESS = PlaneState("stress", "plane stress", is_sheet=True)
GENERALIZED = PlaneState(
    "generalized", "generalized plane strain", SPATIAL_STRAINS, SPATIAL_STRESSES, is_spatial=True, numbers=(1, 2, 6)
)
PLANE_STATES = {state.name: state for state in (PLANE_STRAIN, PLANE_STRESS, GENERALIZED)}


def plane_state_of(document: Mapping[str, Any]) -> PlaneState:
    """Return the plane state of a result.json."""
    return PLANE_STATES[document["case"]["analysis"]["plane"]]
