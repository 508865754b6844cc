"""Two results of one path, point by point, and where their bonds break in another order because loads tie."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from differential.comparison import DIFFERENT, apart
from differential.transforms import sections, waypoints

# Bonds break together up to UTILISATION_TIE; between these shares of it the solver's error decides.
TIE = 1e-5
LEG_END = 1e-9
Point = Mapping[str, Any]


def keyed(path: Sequence[Point], legs: int, by_steps: bool) -> dict[tuple[Any, ...], Point]:
    """The points that are determined: breaks by the bonds broken before, ends of legs, or all steps."""
    found: dict[tuple[Any, ...], Point] = {}
    broken = 0
    for number, point in enumerate(path):
        if by_steps:
            found["step", number] = point
        elif point["broke"]:
            found["break", broken] = point
        elif abs(leg := point["load_factor"] * legs - round(point["load_factor"] * legs)) < LEG_END:
            found["end", round(point["load_factor"] * legs - leg)] = point
        broken += point["broke"]
    return found


def paths_apart(base: Any, other: Any, folder: Path) -> tuple[list[tuple[float, str]], str]:
    """The deviations of the points that both have, and in words where they part because loads tie.

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
    return theirs is not None and all(ours[name] == theirs[name] for name in ("broke", "bonded"))


def _points_apart(ours: Any, theirs: Any) -> list[tuple[float, str]]:
    wrapped = [{"angle": document["path"]} for document in (ours, theirs)]  # `path` itself is left out
    return [(off, words.replace("angle[]", "path[]")) for off, words in apart(*wrapped)]


def ties(document: Any, folder: Path, number: int) -> bool:
    """Whether at a point of a path bonds that do not break come within TIE of breaking, or within TIE of a tie."""
    states = document.get("states") or []
    if number not in states:
        return False
    point = document["path"][number]
    with h5py.File(folder / "result.h5", "r") as file:
        state = file[f"state/{states.index(number)}"]
        traction, status = state["traction"][()], state["status"][()]
        if "axial_traction" in state:
            traction = np.column_stack([traction, state["axial_traction"][()]])
        pair = file["interface/pair"][()] if "interface/pair" in file else np.zeros(len(status), int)
    used = _used(document["case"], traction, pair)[status == 0]
    used = np.concatenate([used, _used_by_tips(document["case"], point)])
    largest = np.sort(used)[::-1] / max(used.max(initial=0.0), 1e-300)
    return bool(np.count_nonzero(largest > 1 - TIE) > point["broke"])


def _used(case: Any, traction: np.ndarray, pair: np.ndarray) -> np.ndarray:
    """(k,) share of their strength, or root of that of their toughness, that tractions (k, c) use."""
    shares = []
    for section in sections(case):
        limits = [section.get(f"{side}_strength") or np.inf for side in ("normal", "tangential", "axial")]
        if section.get("criterion") == "energy":
            limits = [np.sqrt(2 * section["toughness"] * float(section.get(f"{side}_stiffness") or np.inf))
                      for side in ("normal", "tangential", "tangential")]  # fmt: skip
        shares.append(np.array(limits, float)[: traction.shape[1]])
    pulls = np.column_stack([np.maximum(traction[:, 0], 0.0), np.abs(traction[:, 1:])])
    own = pulls / np.array(shares)[pair]
    return np.asarray(own.max(axis=1) if sections(case)[0].get("criterion") == "max" else np.hypot.reduce(own, axis=1))


def _used_by_tips(case: Any, point: Point) -> np.ndarray:
    """(t,) the same of tips, by the energy that they would release."""
    tips = point.get("tips")
    if not tips:
        return np.zeros(0)
    own = [sections(case)[i - 1] for i in tips.get("interface", [1] * len(tips["fibre"]))]
    psi = np.radians(np.asarray(tips["psi"], float))
    least = np.array([section["toughness"] for section in own])
    mode = np.array([section.get("mode_sensitivity", 0.25) for section in own])
    toughness = least * (1 + np.tan((1 - mode) * psi) ** 2)
    return np.asarray(np.sqrt((np.asarray(tips["G_I"]) + np.asarray(tips["G_II"])) / toughness))


def document_of(folder: Path) -> Any:
    """result.json of a folder."""
    return json.loads((folder / "result.json").read_text())
