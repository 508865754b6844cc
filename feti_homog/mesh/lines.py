"""The lines of a cell before they have nodes: points by the share of their length, and how long edges may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from feti_homog.typing import Float, Int


class Lines(Protocol):
    """c lines."""

    @property
    def lengths(self) -> Float:
        """(c,) of each."""

    def points(self, line: Int, share: Float) -> Float:
        """(n, 2) on lines (n,) at these shares (n,) of their lengths."""

    def caps(self, line: Int, share: Float) -> Float:
        """(n,) the longest edge there."""


@dataclass(frozen=True)
class Arcs:
    """Arcs of circles.

    Attributes:
        circles: (a, 3) centre and radius.
        start, span: (a,) angle in radians at which each begins, and how far it turns.
        cap: (a,) longest edge.
    """

    circles: Float
    start: Float
    span: Float
    cap: Float

    def __len__(self) -> int:
        return len(self.start)

    @property
    def lengths(self) -> Float:
        """See `Lines`."""
        return np.asarray(self.span * self.circles[:, 2])

    def points(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        return on_circle(self.circles[line], self.start[line] + self.span[line] * share)

    def caps(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        return self.cap[line]

    def chosen(self, those: slice) -> Arcs:
        """Return some of them."""
        return Arcs(self.circles[those], self.start[those], self.span[those], self.cap[those])


@dataclass(frozen=True)
class Segments:
    """Straight lines.

    Attributes:
        begin, way: (s, 2) where each begins, and where it goes from there.
        cap: (s, 2) longest edge at both ends, linear between them.
    """

    begin: Float
    way: Float
    cap: Float

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def lengths(self) -> Float:
        """See `Lines`."""
        return np.asarray(np.linalg.norm(self.way, axis=1))

    def points(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        return np.asarray(self.begin[line] + share[:, None] * self.way[line])

    def caps(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        low, high = self.cap[line].T
        return np.asarray(low + share * (high - low))

    def chosen(self, those: slice) -> Segments:
        """Return some of them."""
        return Segments(self.begin[those], self.way[those], self.cap[those])


def on_circles(circles: Float, which: Int, angles: Float) -> Float:
    """Points (a, 2) on circles which[a] at angles in radians."""
    return on_circle(circles[which], angles)


def on_circle(circles: Float, angles: Float) -> Float:
    """Points (..., 2) on circles (..., 3) at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * np.stack([np.cos(angles), np.sin(angles)], axis=-1))
