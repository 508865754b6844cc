"""The section [path]: the loads that are gone through."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.config.schema import key
from feti_homog.config.section_values import STRAIN, WAYPOINTS
from feti_homog.config.selectors import BY_EVENTS, BY_INCREMENTS
from feti_homog.config.values import choice, integer

Strain = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LoadPath:
    """Macroscopic strains that are gone through, straight from zero to each waypoint. Give strain or waypoints."""

    strain: Strain | None = key(STRAIN, "The strain at the end, other than zero: a single waypoint.", default=None)
    waypoints: tuple[Strain, ...] | None = key(
        WAYPOINTS, "Strains that are gone through one after the other; each differs from the one before.", default=None
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
    def targets(self) -> tuple[Strain, ...]:
        """The waypoints after the unstrained start."""
        if self.waypoints is not None:
            return self.waypoints
        return () if self.strain is None else (self.strain,)
