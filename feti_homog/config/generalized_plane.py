"""What a case in generalized plane strain may ask for."""

from __future__ import annotations

from feti_homog.config.schema import Selected
from feti_homog.config.sections import ANALYSIS_TYPE, GENERALIZED, GENERALIZED_ANALYSES, PLANE
from feti_homog.config.wording import toml_value


def generalized_faults(selected: Selected) -> list[str]:
    """Faults of what is asked for in generalized plane strain; none in another plane state."""
    analysis = selected[ANALYSIS_TYPE]
    if selected[PLANE] not in GENERALIZED.values or analysis in (*GENERALIZED_ANALYSES, None):
        return []
    offered = " or ".join(map(toml_value, GENERALIZED_ANALYSES))
    return [
        f"[analysis] plane = {toml_value(selected[PLANE])}: works with type = {offered}, not {toml_value(analysis)}"
    ]
