"""Labels of the load of a state in pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.plot_helpers import SYMBOLS
from feti_homog.report.text.analyses import reported
from feti_homog.results.path_curves import FAINT, ZERO, components_above, leading_component
from feti_homog.typing import Document

LONG = 2  # strains beyond which a label of a path has the leading one alone


@dataclass(frozen=True)
class LoadLabels:
    """Labels of the states of a result.

    Attributes:
        leading: the component that a path is about; None of others.
        least_stress: stresses of a path up to which one is what is left of zero.
        given: the load of analysis "load".
    """

    leading: int | None = None
    least_stress: float = 0.0
    given: Mapping[str, float] | None = None

    @classmethod
    def of(cls, document: Document) -> LoadLabels:
        """Return those of a result.json."""
        analysis = reported(document)
        if analysis.is_followed:
            largest = np.abs([point["stress"] for point in document[analysis.name]]).max()
            return cls(leading_component(document), ZERO * float(largest))
        return cls(given=document["case"][analysis.name]["to"] if analysis.picture else None)

    def words(self, attributes: Any) -> list[str]:
        """Return the strains that are seen, and the temperature, of a state with these attributes, as formulas.

        Of a path on which many are seen the leading one and its stress; of a load what it gives.
        """
        if self.given is not None:
            return [_formula(name, value) for name, value in self.given.items()]
        strain, temperature = np.asarray(attributes["strain"]), float(attributes.get("temperature", 0.0))
        strains, stresses = voigt_names(len(strain))
        loads = [(strains[k], float(strain[k])) for k in components_above(FAINT, strain[None])]
        if self.leading is not None and len(loads) > LONG:
            stress = float(attributes["stress"][self.leading])
            loads = [
                (strains[self.leading], float(strain[self.leading])),
                (stresses[self.leading], stress if abs(stress) > self.least_stress else 0.0),
            ]
        loads += [("temperature", temperature)] * (temperature != 0.0)
        return [_formula(name, value) for name, value in loads] or ["no strain"]

    def label(self, attributes: Any, in_line: int = 4) -> str:
        """Join these words, so many in a line."""
        words = self.words(attributes)
        return ",\n".join(", ".join(words[k : k + in_line]) for k in range(0, len(words), in_line))


def _formula(name: str, value: float) -> str:
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    power = rf" \cdot 10^{{{int(exponent)}}}" if exponent else ""
    return f"${SYMBOLS[name]} = {{{mantissa}}}{power}$"
