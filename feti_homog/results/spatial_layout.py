"""What a state of generalized plane strain holds in result.h5: that of a plane one, and what is along the fibres."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from feti_homog.runtime.records import LENGTH, STRESS, described
from feti_homog.materials.voigt import AXIAL_STRESSES, SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.results.field_layout import Item, StatePart, items, items_of
from feti_homog.results.field_views import GROUP_OF_STATES, SPATIAL_VIEWS
from feti_homog.typing import Float, Float32


@dataclass(frozen=True, kw_only=True)
class SpatialStatePart(StatePart):
    """A load case of generalized plane strain and this rank's part of its fields, which do not vary along x3 but for
    the displacement E33 x3."""

    strain: Float = described(f"macroscopic strain {', '.join(SPATIAL_STRAINS)}", shape="(6,)")
    stress_mean: Float = described(f"macroscopic stress {', '.join(SPATIAL_STRESSES)}", STRESS, "(6,)", name="stress")
    temperature: float = described("change of temperature", "temperature")
    stress_33: Float = described("stress 33, along the fibres", STRESS, "(m,)")
    element_strain: Float32 = described(
        "strains of the means over the elements, thermal ones included, components of the tensor 11, 22, "
        "12 = gamma12 / 2, 33",
        shape="(m, 4)",
        dtype="float32",
    )
    von_mises: Float32 = described("von Mises stress of all six components", STRESS, "(m,)", dtype="float32")
    axial_displacement: Float = described(
        "displacement along x3 at x3 = 0, that of the macroscopic strain included", LENGTH, "(n,)"
    )
    axial_fluctuation: Float = described(
        "displacement along x3 less that of the macroscopic strain, periodic", LENGTH, "(n,)"
    )
    axial_stress: Float = described(f"means over the elements, {', '.join(AXIAL_STRESSES)}", STRESS, "(m, 2)")
    axial_strain: Float32 = described(
        "strains of the means over the elements, components of the tensor 23 = gamma23 / 2, 13 = gamma13 / 2",
        shape="(m, 2)",
        dtype="float32",
    )
    axial_traction: Float = described("sigma n along x3", STRESS, "(k,)")
    axial_jump: Float = described("slip along x3: displacement of the matrix minus that of the fibre", LENGTH, "(k,)")
    traction_vector: Float = described("`traction` and `axial_traction` as (x, y, z)", STRESS, "(k, 3)")
    jump_vector: Float = described("`jump` and `axial_jump` as (x, y, z)", LENGTH, "(k, 3)")
    displacement_fibre: Float = described("displacement (x, y, z) of the fibre's face", LENGTH, "(k, 3)")
    displacement_matrix: Float = described(
        "displacement (x, y, z) of the matrix's face, at the same place: `displacement_fibre` plus `jump_vector`",
        LENGTH,
        "(k, 3)",
    )


def spatial_items() -> Iterator[Item]:
    """What result.h5 holds in generalized plane strain, if it is not the same as in `field_layout.items`."""
    plane = set(items())
    yield from (item for item in items_of(SpatialStatePart, GROUP_OF_STATES, SPATIAL_VIEWS) if item not in plane)
