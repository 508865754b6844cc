"""Two results of one path, point by point, and where their bonds break in another order because loads tie."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from differential.comparison import DIFFERENT, apart
from differential.transforms import sections, waypoints
from feti_homog.verify.bonds import cohesive_traction, law_at
from feti_homog.verify.reading import opened

# Bonds break together up to UTILISATION_TIE; between these shares of it the solver's error decides.
TIE = 1e-5
# A leg begins with steps of 1e-9 of it where contact changes at once; rounding of its end is less than this.
LEG_END = 1e-12
Point = Mapping[str, Any]


def keyed(path: Sequence[Point], legs: int, by_steps: bool) -> dict[tuple[Any, ...], Point]:
    """Return the points that are determined: breaks by the bonds broken before, ends of legs, or all steps."""
    found: dict[tuple[Any, ...], Point] = {}
    broken = 0
    for number, point in enumerate(path):
        if by_steps:
            found["step", number] = point
        elif changed(point):
            found["break", broken] = point
        elif abs(leg := point["load_factor"] * legs - round(point["load_factor"] * legs)) < LEG_END:
            found["end", round(point["load_factor"] * legs - leg)] = point
        broken += changed(point)
    return found


def changed(point: Point) -> int:
    """Count the bonds that break, or lose a tooth, at a point."""
    return int(point["broke"]) + int(point.get("softened") or 0)


def paths_apart(base: Any, other: Any, folder: Path) -> tuple[list[tuple[float, str]], str]:
    """Return the deviations of the points that both have, and in words where they part because loads tie.

    `folder` has the files of the base."""
    section, note = base["case"]["path"], ""
    legs, by_steps = len(waypoints(section)), section.get("method") == "increments"
    ours, theirs = (keyed(document["path"], legs, by_steps) for document in (base, other))
    common = list(ours)
    alike = [_alike(ours[key], theirs.get(key)) for key in common]
    if not all(alike) or len(ours) != len(theirs):
        first = alike.index(False) if not all(alike) else len(common) - 1
        place = base["path"].index(ours[common[first]])
        if not any(ties(base, folder, number) for number in range(max(place - 1, 0), place + 1)):
            return [(DIFFERENT, f"path: other breaks from point {place}")], ""
        note, common = f"loads tie at point {place}", common[:first]
    pairs = [{"path": [points[key] for key in common]} for points in (ours, theirs)]
    return _points_apart(*pairs), note


def _alike(ours: Point, theirs: Point | None) -> bool:
    return theirs is not None and all(ours.get(name) == theirs.get(name) for name in ("broke", "softened", "bonded"))


def _points_apart(ours: Any, theirs: Any) -> list[tuple[float, str]]:
    # Of the errors of the mesh a run without files has none.
    points = [[{k: v for k, v in p.items() if "mesh_error" not in k} for p in each["path"]] for each in (ours, theirs)]
    wrapped = [{"angle": each} for each in points]  # `path` itself is left out
    return [(off, words.replace("angle[]", "path[]")) for off, words in apart(*wrapped)]


def ties(document: Any, folder: Path, number: int) -> bool:
    """Return True if more bonds are within TIE of breaking at a point of a path than break."""
    states = document.get("states") or []
    if number not in states:
        return False
    with opened(folder) as files:
        state = next(state for k, state in enumerate(files.states()) if k == states.index(number))
        used = law_at(files, damage=state.damage).utilisation(cohesive_traction(files, state))[state.status == 0]
    point = document["path"][number]
    close = np.abs(np.concatenate([used, _used_by_tips(document["case"], point)]) - 1) < TIE
    return bool(np.count_nonzero(close) > changed(point))


def _used_by_tips(case: Any, point: Point) -> np.ndarray:
    """(t,) the same of tips, by the energy that they would release."""
    tips, found = point.get("tips"), sections(case)
    if not tips or found[0].get("growth") != "released":
        return np.zeros(0)
    rates = zip(tips.get("interface", [1] * len(tips["fibre"])), tips["G_I"], tips["G_II"], strict=True)
    return np.array([_root_of_share(found[i - 1], opening, shear) for i, opening, shear in rates])


def _root_of_share(section: Any, opening: Any, shear: Any) -> np.ndarray:
    """(k,) root of G / G_c of rates G_I and G_II."""
    psi = np.arctan2(np.sqrt(shear), np.sqrt(opening))
    toughness = section["toughness"] * (1 + np.tan((1 - section["mode_sensitivity"]) * psi) ** 2)
    return np.asarray(np.sqrt((opening + shear) / toughness))


def document_of(folder: Path) -> Any:
    """result.json of a folder."""
    return json.loads((folder / "result.json").read_text())
