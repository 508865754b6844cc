"""The sections [path] and [load]: the loads that are gone through, and a single one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from feti_homog.case.asked import AnalysisSection
from feti_homog.case.mixed_load import MixedLoad, Strain
from feti_homog.case.section_values import LOAD, STRAIN, WAYPOINTS
from feti_homog.case.selectors import BY_EVENTS, BY_INCREMENTS, IN_THE_PLANE
from feti_homog.schema.keys import key
from feti_homog.schema.values import choice, integer


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
        "Number of load steps of the whole path, at least one for each waypoint.",
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
