"""Define loads by name, and the analysis sections [angle], [path], [load] and [envelope].

A load gives the strain or the stress of each component; on a path, the previous load provides missing components.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from typing import ClassVar

from feti_homog.case import section_values as kinds
from feti_homog.materials import voigt
from feti_homog.schema import key, types

TEMPERATURE = "temperature"
Strain = tuple[float, ...]
strain_key = partial(key, types.real(), default=None)
stress_key = partial(key, types.real(), unit="stress", default=None)


@dataclass(frozen=True, kw_only=True)
class MixedLoad:
    """Prescribed components of a macroscopic load: the strain or the stress of each, never both.

    On a path, a component that a load does not name keeps its last prescribed value; before, it is free of stress.
    """

    E11: float | None = strain_key("Macroscopic strain E11.")
    E22: float | None = strain_key("Macroscopic strain E22.")
    E33: float | None = strain_key("Macroscopic strain E33.", only=kinds.GENERALIZED)
    gamma23: float | None = strain_key("Macroscopic strain gamma23.", only=kinds.GENERALIZED)
    gamma13: float | None = strain_key("Macroscopic strain gamma13.", only=kinds.GENERALIZED)
    gamma12: float | None = strain_key("Macroscopic strain gamma12.")
    S11: float | None = stress_key("Macroscopic stress S11.")
    S22: float | None = stress_key("Macroscopic stress S22.")
    S33: float | None = stress_key("Macroscopic stress S33.", only=kinds.GENERALIZED)
    S23: float | None = stress_key("Macroscopic stress S23.", only=kinds.GENERALIZED)
    S13: float | None = stress_key("Macroscopic stress S13.", only=kinds.GENERALIZED)
    S12: float | None = stress_key("Macroscopic stress S12.")
    temperature: float | None = key(
        types.real(),
        "Change of temperature, 0 until a load names it. Every phase must give its expansion.",
        unit="temperature",
        default=None,
        only=kinds.GENERALIZED,
    )

    @property
    def named(self) -> dict[str, float]:
        """Return the prescribed components of the load by name."""
        values = ((each.name, getattr(self, each.name)) for each in dataclasses.fields(self))
        return {name: value for name, value in values if value is not None}


LOAD = types.table_of(MixedLoad, "a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}", least=1)
WAYPOINTS = types.list_of(
    types.either("", kinds.STRAIN, LOAD),
    f"a list of strains {kinds.STRAIN_COMPONENTS} or of tables such as {{S11 = 60.0}}",
    least=1,
    most=types.MOST_ROWS,
)


def completed(loads: Sequence[Strain | MixedLoad], plane: str) -> tuple[dict[str, float], ...]:
    """Return the loads of a path, completed: for every component, each dict has the strain or the stress by name.

    In generalized plane strain a load also has the temperature. Components that a load does not name keep the strain or
    stress of the previous load; before the first load, all stresses and the temperature are zero.
    """
    state = voigt.PLANE_STATES[plane]
    unloaded = dict.fromkeys((*state.stresses, TEMPERATURE) if state.is_spatial else state.stresses, 0.0)

    def after(before: Mapping[str, float], load: Strain | MixedLoad) -> dict[str, float]:
        given, full = named(load), dict[str, float]()
        for names in state.components:
            source = before if given.keys().isdisjoint(names) else given
            full |= {name: source[name] for name in names if name in source}
        if TEMPERATURE in before:
            full[TEMPERATURE] = given.get(TEMPERATURE, before[TEMPERATURE])
        return full

    return tuple(accumulate(loads, after, initial=unloaded))[1:]


def first_named(loads: Sequence[Strain | MixedLoad], plane: str) -> dict[str, int]:
    """Return the index of the first load that names each component, by stress name; len(loads) without such a load."""
    return {
        names[1]: next((k for k, load in enumerate(loads) if not named(load).keys().isdisjoint(names)), len(loads))
        for names in voigt.PLANE_STATES[plane].components
    }


def named(load: Strain | MixedLoad) -> dict[str, float]:
    """Return the named components of a load; a strain names E11, E22 and gamma12."""
    return load.named if isinstance(load, MixedLoad) else dict(zip(voigt.STRAINS, load, strict=True))


class AnalysisSection:
    """The section of an analysis; by default no bond breaks, as for types of analysis without a section.

    Attributes:
        breaks: whether bonds may break under the loads of the analysis.
        is_followed: whether the analysis follows debonding along a load path, and can be resumed.
    """

    breaks: ClassVar[bool] = False
    is_followed: ClassVar[bool] = False

    @property
    def openings(self) -> tuple[float, ...]:
        """Return the successive openings, in degrees, that all arcs share; () if each arc has its own angle."""
        return ()

    @property
    def placed(self) -> Mapping[str, Strain | MixedLoad]:
        """Return the loads of [path] or [load] by their keys in the section; empty for other sections."""
        return {}

    def solves(self, loads: int, one_sided: bool) -> int:
        """Return the number of solves under `loads` unit loads; one-sided contact needs both signs of each load."""
        return 2 * loads if one_sided else loads


FAMILIES = (voigt.SPATIAL_STRESSES, voigt.SPATIAL_STRAINS)
PLANE_OF_LOADS = types.either(
    f"two different names, both of stresses ({', '.join(voigt.SPATIAL_STRESSES)}) or both of strains "
    f"({', '.join(voigt.SPATIAL_STRAINS)})",
    *(types.list_of(types.choice(*family), "", count=2, unique=True) for family in FAMILIES),
)


@dataclass(frozen=True, kw_only=True)
class Angle(AnalysisSection):
    """Successive openings of the debonded arcs."""

    values: tuple[float, ...] = key(kinds.OPENINGS, "Openings of all arcs of [interface] debonded.", unit="degrees")
    strain: Strain | None = key(
        kinds.STRAIN,
        "Macroscopic strain, other than zero; by default the three unit strains, which give the effective stiffness.",
        absent="unit strains",
        only=kinds.IN_THE_PLANE,
    )

    @property
    def openings(self) -> tuple[float, ...]:
        """Return the successive openings of all arcs, in degrees."""
        return self.values

    def solves(self, loads: int, one_sided: bool) -> int:
        """Return the number of solves: one per opening under `strain`, else one per opening and unit load."""
        return len(self.values) * (loads if self.strain is None else 1)


@dataclass(frozen=True, kw_only=True)
class Envelope(AnalysisSection):
    """The onset of debonding, or of softening without teeth, on rays from zero in a plane of stresses or strains."""

    breaks: ClassVar[bool] = True

    plane: tuple[str, str] = key(
        PLANE_OF_LOADS,
        "The two axes of the plane; all other stresses, or all other strains, are zero. In plane strain and plane "
        'stress, two of S11, S22, S12 or of E11, E22, gamma12; with plane = "generalized", two of all six components, '
        "where S12 is shear across the fibres, S13 and S23 are shear along the fibres.",
    )
    directions: int = key(
        types.integer(least=4, most=100_000),
        "Number of rays, evenly spaced; the first is along the first axis. On a ray, the load is a factor times "
        "(cos, sin) of the direction.",
        default=72,
    )
    temperature: float | None = key(
        types.real(),
        "Change of temperature before the load, at zero stress in a plane of stresses, at zero strain in a plane of "
        "strains. Every phase must give its expansion.",
        unit="temperature",
        default=None,
        only=kinds.GENERALIZED,
    )


@dataclass(frozen=True, kw_only=True)
class LoadPath(AnalysisSection):
    """Macroscopic loads along straight lines from zero through all waypoints. Give strain, to or waypoints."""

    breaks: ClassVar[bool] = True
    is_followed: ClassVar[bool] = True

    strain: Strain | None = key(
        kinds.STRAIN,
        "The strain at the end, other than zero: a single waypoint.",
        default=None,
        only=kinds.IN_THE_PLANE,
        instead="to = {E11 = ...}",
    )
    to: MixedLoad | None = key(
        LOAD,
        "The load at the end, strains and stresses by name, other than zero: a single waypoint. Components that it "
        "does not name are free of stress.",
        default=None,
    )
    waypoints: tuple[Strain | MixedLoad, ...] | None = key(
        WAYPOINTS,
        "Loads that the path reaches in turn: each is a strain or a table as in to, and differs from the load before. "
        "Components that a table does not name keep their last prescribed values; before, they are free of stress.",
        default=None,
    )
    method: str = key(
        types.choice("events", "increments"),
        '"events": every break at its exact load; "increments": equal load steps.',
        default="events",
    )
    increments: int | None = key(
        types.integer(least=1, most=1_000_000),
        "Number of load steps of the whole path, at least one for each waypoint. Steps end on every waypoint if it "
        "is a multiple of the number of waypoints; otherwise they cut the corners of the path.",
        only=kinds.BY_INCREMENTS,
    )
    release: str = key(
        types.choice("all", "worst"),
        'In a step, "all" overloaded bonds break at once, or the "worst" first, until none is overloaded.',
        default="all",
        only=kinds.BY_INCREMENTS,
    )
    max_events: int = key(
        types.integer(least=1, most=10**9),
        "Stop after this many events, with exit code 3; --resume with a higher number continues.",
        default=100_000,
        only=kinds.BY_EVENTS,
    )

    @property
    def placed(self) -> Mapping[str, Strain | MixedLoad]:
        """Return the waypoints by their keys in the section."""
        if self.waypoints is not None:
            return {f"waypoints[{k}]": load for k, load in enumerate(self.waypoints)}
        return {name: load for name, load in (("strain", self.strain), ("to", self.to)) if load is not None}


@dataclass(frozen=True, kw_only=True)
class SingleLoad(AnalysisSection):
    """The one macroscopic load under which the cell is in equilibrium; nothing breaks."""

    to: MixedLoad = key(
        LOAD,
        "The load, strains and stresses by name, other than zero. Components that it does not name are free of stress.",
    )

    @property
    def placed(self) -> Mapping[str, Strain | MixedLoad]:
        """Return the load by its key in the section."""
        return {"to": self.to}
