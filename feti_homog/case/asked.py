"""Questions that the section of every analysis answers for the floors above."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from feti_homog.case.mixed_load import MixedLoad, Strain


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
