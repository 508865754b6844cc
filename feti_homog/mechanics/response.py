"""Numbers of stress-strain paths: what a rising load follows, the first leg, the component that leads.

Points are those of `path` in result.json: mappings with `load_factor`, `strain` (n,) and `stress` (n,), the latter in
the unit of the moduli; n = 3, of generalized plane strain 6, in the orders of `voigt`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.mechanics.voigt import STRAINS, voigt_names
from feti_homog.typing import Float

SAME_LOAD = 1e-9  # load factors that differ by less, relatively, are one
NOISE = 1e-6  # shares of the largest stress of a path up to which a component in space is what is left of zero

Point = Mapping[str, Any]
Document = Mapping[str, Any]


def waypoints(document: Document) -> list[dict[str, float]]:
    """What each waypoint of a path names, or a single load: strains, stresses and a temperature."""
    path = document["case"]["path" if "path" in document else "load"]
    given = path.get("waypoints") or [path[name] for name in ("to", "strain") if path.get(name) is not None]
    return [dict(load) if isinstance(load, Mapping) else dict(zip(STRAINS, load, strict=True)) for load in given]


def leading_component(document: Document) -> int:
    """The place of the component that a path or a single load is about: of those that a waypoint names with a strain or
    a stress other than zero the largest of its kind, of two that of the larger strain; of a temperature alone the
    largest strain."""
    points = document.get("path") or [document["load"]]
    largest = np.abs([point["strain"] for point in points]).max(axis=0)
    named: dict[str, float] = {}
    for load in waypoints(document):
        named |= {name: max(abs(value), named.get(name, 0.0)) for name, value in load.items()}
    leading = [
        max(range(len(family)), key=[named.get(name, 0.0) for name in family].__getitem__)
        for family in voigt_names(len(largest))
        if any(named.get(name) for name in family)
    ]
    return int(max(leading or range(len(largest)), key=largest.__getitem__))


def shown_stresses(points: Sequence[Point], leading: int) -> list[int]:
    """Places of the stresses that are worth a curve or a column: in the plane all, in space those that are not zero,
    and the leading one."""
    largest = np.abs([point["stress"] for point in points]).max(axis=0)
    if len(largest) == len(STRAINS):
        return list(range(len(largest)))
    return [k for k, size in enumerate(largest) if k == leading or size > NOISE * largest.max()]


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
    """(v, n + 1) stresses and a component of strain at the corners of a proportional path when the load only rises.

    At a load t where bonds break, all break whose load is lower once the first are gone: at constant load the state
    jumps to the next branch that holds, each branch being a ray through zero: Sigma(t) = Sigma(t') t / t', and so E.
    Where strains are given the stress falls, where stresses are given the strain grows.
    """
    load = np.array([point["load_factor"] for point in points])
    values = np.array([[*point["stress"], point["strain"][component]] for point in points])
    records = np.flatnonzero(load >= np.maximum.accumulate(load))
    corners = [np.zeros(values.shape[1]), values[records[0]]]
    for before, after in pairwise(records):
        corners += [values[after] * load[before] / load[after], values[after]]
    return np.array(corners)


def rising_strain(document: Document) -> Float | None:
    """(v, n + 1) stresses and the size of the leading strain along a path of one leg, the load only rising.

    None of any other result, and where the leading strain does not rise with the load.
    """
    points = document.get("path")
    if not points or legs(document) != 1:
        return None
    component = leading_component(document)
    if is_proportional(document):
        curve = strain_controlled(points, component)
    else:
        values = np.array([[*point["stress"], point["strain"][component]] for point in points])
        curve = np.vstack([np.zeros(values.shape[1]), values])
    curve[:, -1] *= np.sign(curve[-1, -1])
    rises = np.diff(curve[:, -1]) >= -SAME_LOAD * np.abs(curve[:, -1]).max()
    return np.asarray(curve) if rises.all() else None


def first_drop(points: Sequence[Point]) -> tuple[Float, int]:
    """(n,) stress left when the bonds that break at the first point of a proportional path are gone, the load being
    held there, and the number of the point whose branch it is on."""
    load = points[0]["load_factor"]
    number = next((n for n, point in enumerate(points) if n and point["load_factor"] >= load), len(points) - 1)
    return np.asarray(points[number]["stress"]) * load / points[number]["load_factor"], number
