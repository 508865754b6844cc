"""Numbers of stress-strain paths: what a rising strain follows, the first leg, the strain that leads.

Points are those of `path` in result.json: mappings with `load_factor`, `strain` [E11, E22, gamma12] and `stress`
[S11, S22, S12], the latter in the unit of the moduli.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Float

SAME_LOAD = 1e-9  # load factors that differ by less, relatively, are one

Point = Mapping[str, Any]
Document = Mapping[str, Any]


def leading_component(points: Sequence[Point]) -> int:
    """Which component of strain is the largest on a path: 0, 1 or 2."""
    return int(np.abs([point["strain"] for point in points]).max(axis=0).argmax())


def legs(document: Document) -> int:
    """How many straight legs the path of a case has."""
    return len(document["case"]["path"].get("waypoints", [0]))


def first_leg(document: Document) -> int:
    """How many points of a path are on its first leg; of increments all, for they are drawn alike."""
    points = document["path"]
    if document["case"]["path"]["method"] == "increments":
        return len(points)
    end = (1.0 + SAME_LOAD) / legs(document)
    return next((n for n, point in enumerate(points) if point["load_factor"] > end), len(points))


def is_proportional(document: Document) -> bool:
    """Whether every point is on a ray of its own from zero: events along one leg, where the response is homogeneous."""
    return document["case"]["path"]["method"] == "events" and legs(document) == 1


def strain_controlled(points: Sequence[Point], component: int) -> Float:
    """(v, 4) S11, S22, S12 and a component of strain at the corners of a proportional path when the strain only rises.

    At a load t where bonds break, all break whose load is lower once the first are gone: the stress falls at constant
    strain to the next branch that holds, each branch being a ray through zero: Sigma(t) = Sigma(t') t / t'.
    """
    load = np.array([point["load_factor"] for point in points])
    values = np.array([[*point["stress"], point["strain"][component]] for point in points])
    records = np.flatnonzero(load >= np.maximum.accumulate(load))
    corners = [np.zeros(4), values[records[0]]]
    for before, after in pairwise(records):
        corners += [values[after] * load[before] / load[after], values[after]]
    return np.array(corners)


def rising_strain(document: Document) -> Float | None:
    """(v, 4) S11, S22, S12 and the size of the leading strain along a path of one leg, the strain only rising.

    None of any other result.
    """
    points = document.get("path")
    if not points or legs(document) != 1:
        return None
    component = leading_component(points)
    if is_proportional(document):
        curve = strain_controlled(points, component)
    else:
        curve = np.array([[0.0] * 4, *([*point["stress"], point["strain"][component]] for point in points)])
    return np.asarray(curve * [1.0, 1.0, 1.0, np.sign(curve[-1, 3])])


def first_drop(points: Sequence[Point]) -> tuple[Float, int]:
    """(3,) stress left when the bonds that break at the first point of a proportional path are gone, the strain being
    held there, and the number of the point whose branch it is on."""
    load = points[0]["load_factor"]
    number = next((n for n, point in enumerate(points) if n and point["load_factor"] >= load), len(points) - 1)
    return np.asarray(points[number]["stress"]) * load / points[number]["load_factor"], number
