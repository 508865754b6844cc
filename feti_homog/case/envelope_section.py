"""The section [envelope]: the plane of macroscopic stresses or strains in which the onset of debonding is sought."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from feti_homog.case.asked import AnalysisSection
from feti_homog.case.selectors import GENERALIZED
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.schema.keys import key
from feti_homog.schema.values import choice, either, integer, list_of, real

FAMILIES = (SPATIAL_STRESSES, SPATIAL_STRAINS)


PLANE_OF_LOADS = either(
    f"two different names, both of stresses ({', '.join(SPATIAL_STRESSES)}) or both of strains "
    f"({', '.join(SPATIAL_STRAINS)})",
    *(list_of(choice(*family), "", count=2, unique=True) for family in FAMILIES),
)


@dataclass(frozen=True, kw_only=True)
class Envelope(AnalysisSection):
    """The plane of macroscopic stresses or strains in which the onset of debonding is sought, along rays from zero."""

    breaks: ClassVar[bool] = True

    plane: tuple[str, str] = key(
        PLANE_OF_LOADS,
        "The two axes of the plane; all other stresses, or all other strains, are zero: in plane strain and plane "
        'stress those in the plane, S11, S22, S12 or E11, E22, gamma12; in plane = "generalized" all six.',
    )
    directions: int = key(
        integer(least=4, most=100_000),
        "Number of rays, evenly spaced; the first is along the first axis. On each the load is a factor times "
        "(cos, sin) of its direction.",
        default=72,
    )
    temperature: float | None = key(
        real(),
        "A change of temperature that comes first, at zero stress in a plane of stresses, at zero strain in one of "
        "strains. Every phase must give its expansion.",
        unit="temperature",
        default=None,
        only=GENERALIZED,
    )
