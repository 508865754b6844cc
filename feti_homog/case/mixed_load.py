"""Loads by name: of each component its strain or its stress, and what they are in full along a path."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from feti_homog.case.section_values import STRAIN, STRAIN_COMPONENTS
from feti_homog.case.selectors import GENERALIZED
from feti_homog.materials.voigt import PLANE_STATES, STRAINS
from feti_homog.schema.keys import Condition, key
from feti_homog.schema.values import either, list_of, real, table_of

TEMPERATURE = "temperature"
Strain = tuple[float, ...]


def _strain(name: str, *only: Condition) -> Any:
    return key(real(), f"Macroscopic strain {name}.", default=None, only=only)


def _stress(name: str, *only: Condition) -> Any:
    return key(real(), f"Macroscopic stress {name}.", unit="stress", default=None, only=only)


@dataclass(frozen=True, kw_only=True)
class MixedLoad:
    """Prescribed components of a macroscopic load: the strain or the stress of each, never both.

    What a load of a path does not name stays as it was prescribed last; what none has named so far is free of stress.
    """

    E11: float | None = _strain("E11")
    E22: float | None = _strain("E22")
    E33: float | None = _strain("E33", GENERALIZED)
    gamma23: float | None = _strain("gamma23", GENERALIZED)
    gamma13: float | None = _strain("gamma13", GENERALIZED)
    gamma12: float | None = _strain("gamma12")
    S11: float | None = _stress("S11")
    S22: float | None = _stress("S22")
    S33: float | None = _stress("S33", GENERALIZED)
    S23: float | None = _stress("S23", GENERALIZED)
    S13: float | None = _stress("S13", GENERALIZED)
    S12: float | None = _stress("S12")
    temperature: float | None = key(
        real(),
        "A change of temperature, 0 until it is named. Every phase must give its expansion.",
        unit="temperature",
        default=None,
        only=GENERALIZED,
    )

    @property
    def named(self) -> dict[str, float]:
        """The values that are given, by name."""
        values = ((each.name, getattr(self, each.name)) for each in dataclasses.fields(self))
        return {name: value for name, value in values if value is not None}


LOAD = table_of(MixedLoad, "a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}", least=1)
WAYPOINTS = list_of(
    either("", STRAIN, LOAD), f"a list of strains {STRAIN_COMPONENTS} or of tables such as {{S11 = 60.0}}", least=1
)


def completed(loads: Sequence[Strain | MixedLoad], plane: str) -> tuple[dict[str, float], ...]:
    """Return the loads of a path in full.

    Of each component one name and value, and the temperature in generalized plane strain. What a load does not name is
    that of the load before, at first a stress of zero.
    """
    state = PLANE_STATES[plane]
    unloaded = dict.fromkeys((*state.stresses, *[TEMPERATURE] * state.is_spatial), 0.0)

    def after(before: Mapping[str, float], load: Strain | MixedLoad) -> dict[str, float]:
        given, full = named(load), dict[str, float]()
        for names in state.components:
            source = given if not given.keys().isdisjoint(names) else before
            full |= {name: source[name] for name in names if name in source}
        return full | {name: given.get(name, value) for name, value in before.items() if name == TEMPERATURE}

    return tuple(accumulate(loads, after, initial=unloaded))[1:]


def first_named(loads: Sequence[Strain | MixedLoad], plane: str) -> dict[str, int]:
    """By the name of its stress, which load is the first to name each component; len(loads) if none does."""
    return {
        names[1]: next((k for k, load in enumerate(loads) if not named(load).keys().isdisjoint(names)), len(loads))
        for names in PLANE_STATES[plane].components
    }


def named(load: Strain | MixedLoad) -> dict[str, float]:
    """Return the named components of a load, [E11, E22, gamma12] if it is a strain."""
    return load.named if isinstance(load, MixedLoad) else dict(zip(STRAINS, load, strict=True))
