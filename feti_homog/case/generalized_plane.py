"""What only a case in generalized plane strain may ask for."""

from __future__ import annotations

from feti_homog.case.sections import OUT_OF_PLANE_STRESSES
from feti_homog.case.selectors import DRAWN_STRESS, GENERALIZED, IN_THE_PLANE, PLANE
from feti_homog.schema.keys import Selected
from feti_homog.schema.wording import toml_value


def generalized_faults(selected: Selected) -> list[str]:
    """Faults of what only generalized plane strain has in another plane state."""
    stress = selected[DRAWN_STRESS]
    if selected[PLANE] not in IN_THE_PLANE.values or stress not in OUT_OF_PLANE_STRESSES:
        return []
    owner = f"{GENERALIZED.in_words('output')}, not {toml_value(selected[PLANE])}"
    return [f"[output] stress = {toml_value(stress)}: belongs to {owner}"]
