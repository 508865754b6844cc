"""The cell that a unit of temperature expands without stress, as a state of its own: a sum of states of result.h5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.materials.voigt import SPATIAL_STRAINS
from feti_homog.typing import Array

LOADS = (*SPATIAL_STRAINS, "temperature")


@dataclass(frozen=True)
class SummedTable:
    """Sum of tables times factors, row by row as it is read."""

    tables: Sequence[Any]
    factors: Sequence[float]

    def __len__(self) -> int:
        return len(self.tables[0])

    def __getitem__(self, rows: Any) -> Array:
        parts = (factor * table[rows] for factor, table in zip(self.factors, self.tables, strict=True))
        return np.asarray(sum(parts))


@dataclass(frozen=True)
class FreeExpansion:
    """The state u = u_T + sum_j alpha_j u_j of the unit loads' states, of which pictures read fields of the cell.

    Where no face touches, the states superpose; interfaces are those of the state of the temperature, the last one.
    """

    file: Any
    states: Sequence[Any]
    factors: Sequence[float]
    attrs: Mapping[str, Any]

    @classmethod
    def of(cls, state: Any, document: Mapping[str, Any]) -> FreeExpansion | None:
        """Return that of the state of a unit of temperature; None of another state, and without an expansion."""
        strain, temperature = state.attrs["strain"], state.attrs.get("temperature", 0.0)
        expansion = document.get("thermal_expansion")
        if expansion is None or len(strain) != len(expansion) or np.any(strain) or temperature != 1.0:
            return None
        found = {}
        for other in state.file["state"].values():
            loads = np.append(other.attrs["strain"], other.attrs["temperature"])
            if np.count_nonzero(loads) == 1 and loads.max() == 1.0:
                found[LOADS[int(loads.argmax())]] = other
        if len(found) < len(LOADS):
            return None
        attributes = dict(state.attrs) | {"strain": np.array(expansion), "stress": np.zeros(len(expansion))}
        return cls(state.file, [found[load] for load in LOADS], [*expansion, 1.0], attributes)

    def __contains__(self, name: str) -> bool:
        return name in self.states[-1]

    def __getitem__(self, name: str) -> Any:
        tables = [state[name] for state in self.states]
        return SummedTable(tables, self.factors) if np.issubdtype(tables[0].dtype, np.floating) else tables[-1]
