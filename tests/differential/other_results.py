"""Cases whose results follow from each other: paths cut in two, loads by stress instead of strain, onsets."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from differential import comparison, transforms
from differential.comparison import apart, envelopes_apart
from differential.paths import changed, keyed
from differential.random_cases import Drawn
from differential.random_loads import NAMES, components
from differential.random_phases import Document
from differential.random_softening import softens
from differential.setting import Compared, Setting
from differential.transforms import sections
from feti_homog.case.bond_laws import COHESIVE, STIFFNESSES

FAR = 2.0  # times the load at onset
KEPT = {"contact", "debonded", "between", "scatter", "axial_stiffness", *STIFFNESSES, *COHESIVE[:2]}


def split_way(setting: Setting) -> Compared:
    """One leg of a path cut in two at a random place.  Collective."""
    drawn, base = setting.drawn, setting.base
    section, plane = drawn.document["path"], drawn.plane
    loads: list[dict[str, float]] = []
    for load in transforms.waypoints(section):
        loads.append(transforms.full(load, loads[-1] if loads else {}, plane, plane == "generalized"))
    legs = len(loads)
    leg, share = int(setting.rng.integers(legs)), float(setting.rng.uniform(0.1, 0.9))
    begin = _state(keyed(base["path"], legs, False)["end", leg], plane) if leg else {}
    middle = transforms.between(begin, loads[leg], share)
    way = [*loads[:leg], middle, *loads[leg:]]
    kept = {key: value for key, value in section.items() if key not in ("strain", "to", "waypoints")}
    other = setting.solved(drawn.document | {"path": kept | {"waypoints": [_expandable(load, drawn) for load in way]}})
    other["path"] = _joined(other["path"], legs, leg, share)
    rises = all(p["load_factor"] <= q["load_factor"] for p, q in zip(base["path"], base["path"][1:], strict=False))
    if leg == 0 and not rises:
        return _ends_compared(setting, other, legs)
    return setting.compared(other)


def _expandable(load: Mapping[str, float], drawn: Drawn) -> dict[str, float]:
    """Return a load without a temperature if that is never other than zero, for then phases need not expand."""
    warm = any("temperature" in load for load in transforms.waypoints(drawn.document["path"]) if isinstance(load, dict))
    return {name: value for name, value in load.items() if warm or name != "temperature"}


def _state(point: Any, plane: str) -> dict[str, float]:
    """Strains and stresses of a point by name."""
    strains, stresses = NAMES[components(plane)]
    own = dict(zip((*strains, *stresses), (*point["strain"], *point["stress"]), strict=True))
    return own | ({"temperature": point["temperature"]} if "temperature" in point else {})


def _joined(path: list[Any], legs: int, leg: int, share: float) -> list[Any]:
    """Return the points of a path one of whose legs is cut, without the end of its first part, as on the whole one."""
    points, cut = [], (leg + 1) / (legs + 1)
    for point in path:
        place = point["load_factor"] * (legs + 1)
        if abs(point["load_factor"] - cut) < 1e-12 and not changed(point):
            continue
        if place > leg + 1:
            place = max(place - 1, leg + share + (1 - share) * (place - leg - 1))
        elif place > leg:
            place = leg + share * (place - leg)
        points.append(point | {"load_factor": place / legs})
    return points


def _ends_compared(setting: Setting, other: Any, legs: int) -> Compared:
    """After a snap-back, which a second leg does not follow, only the ends of legs are alike, but for energies lost."""
    ours, theirs = (keyed(document["path"], legs, False) for document in (setting.base, other))
    ends = [key for key in ours if key[0] == "end"]
    lost = {"work", "dissipated", "dissipated_strain_controlled", "fracture_energy", "dissipation_ratio", "tips"}
    # Of the errors of the mesh a run without files has none.
    lost |= {name for point in ours.values() for name in point if "mesh_error" in name}
    pairs = [{"angle": [{k: v for k, v in side[key].items() if k not in lost} for key in ends]}
             for side in (ours, theirs)]  # fmt: skip
    return Compared(*max(apart(*pairs)), "ends of legs, after a snap-back")


def stress_back(setting: Setting) -> Compared:
    """Return the strain under the stress that a strain gave. Collective."""
    drawn, document = setting.drawn, dict(setting.drawn.document)
    strains, stresses = NAMES[components(drawn.plane)]
    strain, stress, angle = _response(setting, len(strains))
    if angle is not None:
        del document["angle"]
        document["interface"] = _with_angles(document["interface"], angle)
    to = dict(zip(stresses, map(float, stress), strict=True)) | _temperature(setting)
    document["analysis"] = {"type": "load", "plane": drawn.plane}
    other = setting.solved(document | {"load": {"to": to}})
    off = np.abs(np.array(other["load"]["strain"]) - strain).max() / np.abs(strain).max()
    return Compared(float(off), "load.strain")


def _response(setting: Setting, v: int) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Return a strain, the stress under it, and of an analysis of angles the last of these."""
    base, column = setting.base, int(setting.rng.integers(v))
    if "load" in base:
        return np.array(base["load"]["strain"]), np.array(base["load"]["stress"]), None
    if "effective_stiffness" in base:
        return np.eye(v)[column], np.array(base["effective_stiffness"])[:, column], None
    point = base["angle"][-1]
    if "strain" in point:
        return np.array(point["strain"]), np.array(point["stress"]), point["angle"]
    return np.eye(v)[column], np.array(point["stiffness"])[:, column], point["angle"]


def _temperature(setting: Setting) -> dict[str, float]:
    found = (setting.base.get("load") or {}).get("temperature")
    return {"temperature": found} if found else {}


def _with_angles(interface: Any, angle: float) -> Any:
    """Return the interfaces whose arcs have this opening."""
    if isinstance(interface, list):
        return [_with_angles(section, angle) for section in interface]
    return interface | {"debonded": [arc | {"angle": angle} for arc in interface["debonded"]]}


def onset(setting: Setting) -> Compared:
    """Return the first break of a path along a direction of an envelope. Collective."""
    points = [point for point in setting.base["envelope"] if point.get("factor")]
    if not points:
        return Compared(0.0, "nothing breaks", "nothing to compare")
    point = points[setting.rng.integers(len(points))]
    document, plane = dict(setting.drawn.document), setting.drawn.plane
    section = document.pop("envelope")
    strains, stresses = NAMES[components(plane)]
    of_stress = section["plane"][0] in stresses
    ray = dict.fromkeys(stresses if of_stress else strains, 0.0)
    angle = np.radians(point["angle"])
    way = []
    if "temperature" in section:
        way.append(ray | {"temperature": section["temperature"]})
    for name, part in zip(section["plane"], (np.cos(angle), np.sin(angle)), strict=True):
        ray[name] = float(FAR * point["factor"] * part)
    document = _of_onset(document) | {"path": {"waypoints": [*way, ray], "max_events": 100_000}}
    document["analysis"] = document["analysis"] | {"type": "path"}
    first = _first_break(setting, document)
    if first is None:
        return Compared(comparison.DIFFERENT, "no bond breaks on the path")
    legs = len(way) + 1
    found = {"factor": FAR * point["factor"] * (first["load_factor"] * legs - len(way))}
    both = [[own | {"factor": x["factor"]} for own in [{k: p[k] for k in ("strain", "stress")}]]
            for x, p in ((point, point), (found, first))]  # fmt: skip
    return Compared(*max(envelopes_apart(*both)))


def _of_onset(document: Document) -> Document:
    """Return a case whose bonds break, by both strengths, where those that soften are first damaged: before teeth."""
    if not softens(document):
        return document
    found = []
    for section in sections(document):
        of_table = {} if "openings" not in section else {
            "normal_strength": section["tractions"][0],
            "normal_stiffness": section["tractions"][0] / section["openings"][0],
        }  # fmt: skip
        own = {key: section[key] for key in KEPT & section.keys()} | of_table | {"criterion": "quadratic"}
        if "axial_stiffness" in own:
            # All shear counts by its energy.
            share = own["axial_stiffness"] / own["tangential_stiffness"]
            own["axial_strength"] = own["tangential_strength"] * share**0.5
        found.append(own)
    return document | {"interface": found if isinstance(document["interface"], list) else found[0]}


def _first_break(setting: Setting, document: Document) -> Any:
    """Return the point of a path at which the first bond breaks."""
    other = setting.solved(document)
    return next((point for point in other["path"] if point["broke"]), None)
