"""What pictures say of the load of a state, and which stress they show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.mechanics.response import NOISE, leading_component
from feti_homog.mechanics.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, voigt_names
from feti_homog.typing import Array

SYMBOLS = {
    **{name: (r"\gamma" if name.startswith("g") else "E") + f"_{{{name[-2:]}}}" for name in SPATIAL_STRAINS},
    **{name: rf"\Sigma_{{{name[1:]}}}" for name in SPATIAL_STRESSES},
    "temperature": r"\Delta T",
}
SHORT = 2  # strains that a label has room for beside others
SAME_VALUE = 1e-6  # share of the largest strain up to which one is what is left of zero


@dataclass(frozen=True)
class Labels:
    """How states of a result are labelled.

    Attributes:
        leading: the component that a path or a load is about; None of others.
        least_stress: stresses up to which one is what is left of zero.
        given: the load of analysis "load".
    """

    leading: int | None = None
    least_stress: float = 0.0
    given: Mapping[str, float] | None = None

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Labels:
        """Those of a result.json."""
        if "load" in document:
            return cls(leading_component(document), given=document["case"]["load"]["to"])
        if "path" in document:
            largest = np.abs([point["stress"] for point in document["path"]]).max()
            return cls(leading_component(document), NOISE * float(largest))
        return cls()

    def label(self, attributes: Any) -> str:
        """The strain, and the temperature, of a state with these attributes; of a path with many strains the leading
        one and its stress; of a load what it gives."""
        if self.given is not None:
            return _in_formulas(self.given.items())
        strain, temperature = attributes["strain"], float(attributes.get("temperature", 0.0))
        strains, stresses = voigt_names(len(strain))
        least = SAME_VALUE * np.abs(strain).max()
        loads = [(name, value) for name, value in zip(strains, strain, strict=True) if abs(value) > least]
        if self.leading is not None and len(loads) > SHORT:
            stress = attributes["stress"][self.leading]
            loads = [
                (strains[self.leading], strain[self.leading]),
                (stresses[self.leading], stress if abs(stress) > self.least_stress else 0.0),
            ]
        return _in_formulas([*loads, *([("temperature", temperature)] if temperature else [])])

    def stress_component(self, chosen: str, strains: Array) -> str:
        """The stress that is chosen, else the leading one, if there is one, or that of the largest strain of (k, 3) or
        (k, 6)."""
        if chosen in SPATIAL_STRESSES:
            return chosen
        largest = int(np.argmax(np.abs(strains).max(axis=0)))
        return voigt_names(strains.shape[1])[1][largest if self.leading is None else self.leading]


def _in_formulas(loads: Iterable[tuple[str, float]]) -> str:
    return ", ".join(f"${SYMBOLS[name]} = {{{value:.4g}}}$" for name, value in loads) or "no strain"
