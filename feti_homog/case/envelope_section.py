"""The section [envelope]: the plane of macroscopic stresses or strains in which the onset of debonding is sought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from feti_homog.case.asked import AnalysisSection
from feti_homog.case.selectors import GENERALIZED
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.schema.keys import key
from feti_homog.schema.values import ValueType, integer, real

FAMILIES = (SPATIAL_STRESSES, SPATIAL_STRAINS)


def _is_plane(value: Any) -> bool:
    if not isinstance(value, list) or len(value) != 2 or not all(isinstance(name, str) for name in value):
        return False
    return value[0] != value[1] and any(set(value) <= set(family) for family in FAMILIES)


def pairs_of(*families: Sequence[str]) -> dict[str, Any]:
    """The JSON Schema of two different names of one family."""
    of_one = [{"items": {"enum": list(family)}} for family in families]
    return {"type": "array", "minItems": 2, "maxItems": 2, "uniqueItems": True, "anyOf": of_one}


PLANE_OF_LOADS = ValueType(
    f"two different names, both of stresses ({', '.join(SPATIAL_STRESSES)}) or both of strains "
    f"({', '.join(SPATIAL_STRAINS)})",
    _is_plane,
    tuple,
    pairs_of(*FAMILIES),
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
