"""Sections of the analyses: what all of them answer, and [angle], [path], [load] and [envelope]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from feti_homog.case.material_sections import missing_expansions
from feti_homog.case.mixed_load import LOAD, TEMPERATURE, WAYPOINTS, MixedLoad, Strain, completed, first_named, named
from feti_homog.case.section_values import OPENINGS, STRAIN
from feti_homog.case.selectors import BY_EVENTS, BY_INCREMENTS, GENERALIZED, IN_THE_PLANE
from feti_homog.materials.forms import Material, Orthotropic
from feti_homog.materials.voigt import PLANE_STATES, SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.schema.keys import key
from feti_homog.schema.values import choice, either, integer, list_of, real
from feti_homog.schema.wording import toml_value


class AnalysisSection:
    """The section of an analysis; the values here are those of one in which the load breaks no bonds.

    Attributes:
        breaks: whether bonds break under its loads.
        is_followed: whether it goes from event to event, debonding as it goes, and can be resumed.
    """

    breaks: ClassVar[bool] = False
    is_followed: ClassVar[bool] = False

    @property
    def openings(self) -> tuple[float, ...]:
        """Openings of the arcs without an angle of their own, one after the other; none if they have angles."""
        return ()

    @property
    def placed(self) -> Mapping[str, Strain | MixedLoad]:
        """The loads as they are given, by their places in the section; none of unit loads."""
        return {}

    def solves(self, loads: int, one_sided: bool) -> int:
        """Equilibria of a problem with so many unit loads, under plus and minus each where faces touch one-sidedly."""
        return 2 * loads if one_sided else loads


class Stiffness(AnalysisSection):
    """The effective stiffness, which has no section."""


FAMILIES = (SPATIAL_STRESSES, SPATIAL_STRAINS)


PLANE_OF_LOADS = either(
    f"two different names, both of stresses ({', '.join(SPATIAL_STRESSES)}) or both of strains "
    f"({', '.join(SPATIAL_STRAINS)})",
    *(list_of(choice(*family), "", count=2, unique=True) for family in FAMILIES),
)


@dataclass(frozen=True, kw_only=True)
class Angle(AnalysisSection):
    """Openings of the arcs, one after the other."""

    values: tuple[float, ...] = key(OPENINGS, "Openings of all arcs of [interface] debonded.", unit="degrees")
    strain: Strain | None = key(
        STRAIN,
        "Macroscopic strain, other than zero; by default the three unit strains, which give the effective stiffness.",
        default=None,
        default_words="unit strains",
        only=IN_THE_PLANE,
    )

    @property
    def openings(self) -> tuple[float, ...]:
        """All of them."""
        return self.values

    def solves(self, loads: int, one_sided: bool) -> int:
        """Return the number of solves of all openings."""
        return len(self.values) * (loads if self.strain is None else 1)


@dataclass(frozen=True, kw_only=True)
class Envelope(AnalysisSection):
    """The plane of macroscopic stresses or strains in which the onset of debonding is sought, along rays from zero."""

    breaks: ClassVar[bool] = True

    plane: tuple[str, str] = key(
        PLANE_OF_LOADS,
        "The two axes of the plane; all other stresses, or all other strains, are zero: in plane strain and plane "
        'stress those in the plane, S11, S22, S12 or E11, E22, gamma12; in plane = "generalized" all six, of which S12 '
        "is shear across the fibres, S13 and S23 are along them.",
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


@dataclass(frozen=True, kw_only=True)
class LoadPath(AnalysisSection):
    """Macroscopic loads that are gone through, straight from zero to each waypoint. Give strain, to or waypoints."""

    breaks: ClassVar[bool] = True
    is_followed: ClassVar[bool] = True

    strain: Strain | None = key(
        STRAIN,
        "The strain at the end, other than zero: a single waypoint.",
        default=None,
        only=IN_THE_PLANE,
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
        "Loads that are gone through one after the other, each a strain or a table as in to; each differs from the one "
        "before. What a table does not name stays as it was prescribed last, at first free of stress.",
        default=None,
    )
    method: str = key(
        choice("events", "increments"),
        '"events": every break at its exact load; "increments": equal load steps.',
        default="events",
    )
    increments: int | None = key(
        integer(least=1, most=1_000_000),
        "Number of load steps of the whole path, at least one for each waypoint. Steps end on every waypoint if it "
        "is a multiple of their number; others pass by the corners of the path.",
        only=BY_INCREMENTS,
    )
    release: str = key(
        choice("all", "worst"),
        'In a step "all" bonds over their strength break at once, or the "worst" first, until none is over.',
        default="all",
        only=BY_INCREMENTS,
    )
    max_events: int = key(
        integer(least=1, most=10**9),
        "Stop after so many events, with exit code 3; --resume with a higher number goes on.",
        default=100_000,
        only=BY_EVENTS,
    )

    @property
    def targets(self) -> tuple[Strain | MixedLoad, ...]:
        """The waypoints after the unloaded start, as they are given."""
        return tuple(self.placed.values())

    @property
    def placed(self) -> Mapping[str, Strain | MixedLoad]:
        """The waypoints by their places in the section."""
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
        """The load."""
        return {"to": self.to}


def load_faults(path: LoadPath | None, load: SingleLoad | None, plane: str | None) -> list[str]:
    """Faults of loads that are zero or repeat the last one, and of too few increments; None is a faulty plane state."""
    if load is not None and not any(load.to.named.values()):
        return [f"[load] to = {_in_words(load.to)}: expected a load other than zero"]
    if path is None:
        return []
    faults = []
    if plane is not None and [path.strain, path.to, path.waypoints].count(None) == 2:
        faults = _repeated_loads(path, plane)
    if path.increments is not None and path.increments < len(path.targets):
        faults.append(f"[path] increments = {path.increments}: expected at least one for each waypoint")
    return faults


def _repeated_loads(path: LoadPath, plane: str) -> list[str]:
    """Faults of waypoints at which the path already is."""
    placed = path.placed
    loads = completed(path.targets, plane)
    is_last = [not any(loads[0].values()), *(before == after for before, after in pairwise(loads))]
    last = ["zero, where the path begins", *placed]
    nouns = ["load" if isinstance(load, MixedLoad) else "strain" for load in placed.values()]
    return [
        f"[path] {place} = {_in_words(load)}: expected a {nouns[k]} other than {last[k]}"
        for k, (place, load) in enumerate(placed.items())
        if is_last[k]
    ]


def _in_words(load: Strain | MixedLoad) -> str:
    return toml_value(load.named if isinstance(load, MixedLoad) else list(load))


def expansion_faults(path: LoadPath | None, load: SingleLoad | None, materials: Mapping[str, Material]) -> list[str]:
    """Faults of phases without thermal expansion, where a load names a temperature."""
    placed: dict[str, Strain | MixedLoad] = {} if load is None else {"[load] to": load.to}
    placed |= {} if path is None else {f"[path] {place}": each for place, each in path.placed.items()}
    place = next((place for place, load in placed.items() if TEMPERATURE in named(load)), None)
    return [] if place is None else missing_expansions(materials, f"{place}.{TEMPERATURE}")


def axes_lines(kind: str, section: AnalysisSection, materials: Mapping[str, Material], plane: str) -> tuple[str, ...]:
    """Return the axes of loads and of constants of phases that could be of a ply, in a line; none in a plane."""
    if not PLANE_STATES[plane].is_spatial:
        return ()
    from feti_homog.materials.constants import axes_line  # which nothing in a plane needs

    loaded = [name for load in section.placed.values() for name, value in named(load).items() if value]
    of_loads = axes_line(section.plane if isinstance(section, Envelope) else loaded)
    phases = [f"[material.{name}]" for name, own in materials.items() if isinstance(own, Orthotropic)]
    lines = [f"[{kind}] {of_loads}"] if of_loads else []
    lines += [f"{', '.join(phases)} E1 and E2 are across the fibres; along them E3"] if phases else []
    return (". ".join(lines),) if lines else ()


def stress_free(section: str, placed: Mapping[str, Strain | MixedLoad], plane: str) -> tuple[str, ...]:
    """List the components free of stress because no load of a section names them, or none so far; a line each."""
    first = first_named(tuple(placed.values()), plane)
    words = ["", *(f"stress-free until {place}" for place in [*placed][1:]), "never named: stress-free"]
    unnamed = {k: [name for name, number in first.items() if number == k] for k in range(1, len(words))}
    return tuple(f"[{section}] {', '.join(names)}: {words[k]}" for k, names in unnamed.items() if names)
