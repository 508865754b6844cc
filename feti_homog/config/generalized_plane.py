"""What a case in generalized plane strain may ask for."""

from __future__ import annotations

from feti_homog.config.schema import Selected
from feti_homog.config.sections import GENERALIZED_ANALYSES, OUT_OF_PLANE_STRESSES
from feti_homog.config.selectors import ANALYSIS_TYPE, DRAWN_STRESS, GENERALIZED, IN_THE_PLANE, PLANE
from feti_homog.config.wording import toml_value


def generalized_faults(selected: Selected) -> list[str]:
    """Faults of what is asked for in generalized plane strain, and of what only that has in another plane state."""
    analysis, stress = selected[ANALYSIS_TYPE], selected[DRAWN_STRESS]
    if selected[PLANE] in IN_THE_PLANE.values and stress in OUT_OF_PLANE_STRESSES:
        planes = " or ".join(map(toml_value, GENERALIZED.values))
        owner = f"[analysis] plane = {planes}, not {toml_value(selected[PLANE])}"
        return [f"[output] stress = {toml_value(stress)}: belongs to {owner}"]
    if selected[PLANE] not in GENERALIZED.values or analysis in (*GENERALIZED_ANALYSES, None):
        return []
    *some, last = map(toml_value, GENERALIZED_ANALYSES)
    offered = f"{', '.join(some)} or {last}"
    return [
        f"[analysis] plane = {toml_value(selected[PLANE])}: works with type = {offered}, not {toml_value(analysis)}"
    ]
