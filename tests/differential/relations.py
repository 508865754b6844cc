"""Relations between the results of a random case and of others that say the same, or that follow from it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from differential import comparison, transforms
from differential.comparison import apart, envelopes_apart
from differential.paths import keyed, paths_apart
from differential.random_cases import Drawn
from differential.random_loads import NAMES, components
from differential.random_phases import Document
from differential.twin import SolvedAnew

from feti_homog import run
from feti_homog.common.mpi_errors import on_root
from feti_homog.errors import FetiHomogError, NotCarriedError
from feti_homog.output.files.checkpoint import Checkpoint
from feti_homog.verification.certificate import verify

# Units that a case's own are multiplied by.
STRESS_UNITS = (1e-9, 1e9)
LENGTH_UNITS = (1e-7, 1e7)  # widths are between 0.1 and 10 before, and a case file's between 1e-9 and 1e9
MOST_SUBDOMAINS = 12
STATES = 4  # of a result are solved anew
FAR = 2.0  # times the load at onset


class Killed(FetiHomogError):
    """The end of a run at an event, on all ranks."""


@dataclass(frozen=True)
class Compared:
    """How far the two sides of a relation are apart, in what, and a note of what was not compared."""

    deviation: float
    what: str
    note: str = ""


@dataclass(frozen=True)
class Setting:
    """A case with its result on one rank, and what a relation may use.

    Attributes:
        comm: the ranks that solve, all of which call.
        base: result.json of the case, and `files` its folder.
        rng: the same on all ranks.
        work: an empty folder.
    """

    drawn: Drawn
    base: Any
    files: Path
    comm: Any
    rng: np.random.Generator
    work: Path

    def solved(self, document: Document, **keys: Any) -> Any:
        """result.json of another case.  Collective."""
        result = run(self.drawn.parsed(document), self.comm, **keys)
        return json.loads(json.dumps(result.document, default=lambda array: array.tolist()))

    def compared(self, other: Any) -> Compared:
        """The result of the same case, found otherwise, against the base."""
        found, note = apart(self.base, other), ""
        if self.drawn.analysis == "path":
            points, note = paths_apart(self.base, other, self.files)
            found += points
        if self.drawn.analysis == "envelope":
            found += envelopes_apart(self.base["envelope"], other["envelope"])
        return Compared(*max(found), note)


def ranks(setting: Setting) -> Compared:
    """The same case on the ranks of `comm`.  Collective."""
    return setting.compared(setting.solved(setting.drawn.document))


def unit_of_stress(setting: Setting) -> Compared:
    """All stresses in another unit.  Collective."""
    unit = _unit(setting, STRESS_UNITS)
    other = setting.solved(transforms.in_units(setting.drawn.document, unit, 1.0))
    return setting.compared(comparison.in_units(other, 1 / unit, 1.0))


def unit_of_length(setting: Setting) -> Compared:
    """All lengths in another unit.  Collective."""
    unit = _unit(setting, LENGTH_UNITS)
    drawn = setting.drawn
    document = transforms.in_units(drawn.document, 1.0, unit)
    if "file" in document["cell"]:
        on_root(setting.comm, transforms.scale_mesh, drawn.folder, setting.work, unit)
        drawn = Drawn(drawn.seed, drawn.number, document, setting.work)
    other = Setting(drawn, setting.base, setting.files, setting.comm, setting.rng, setting.work).solved(document)
    return setting.compared(comparison.in_units(other, 1.0, 1 / unit))


def _unit(setting: Setting, within: tuple[float, float]) -> float:
    return float(10.0 ** setting.rng.uniform(*np.log10(within)))


def order_of_input(setting: Setting) -> Compared:
    """Keys, rows of tables, arcs and sections of interfaces in another order.  Collective."""
    document, fibres, order = transforms.reordered(setting.rng, setting.drawn.document)
    return setting.compared(transforms.relabelled(setting.solved(document), fibres, order))


def pieces(setting: Setting) -> Compared:
    """Bodies cut into other subdomains, or at the sides of the cell.  Collective."""
    document, rng = dict(setting.drawn.document), setting.rng
    document["cell"] = document["cell"] | {"bodies": str(rng.choice(["torus", "plane"]))}
    document["decomposition"] = {"subdomains": int(rng.integers(2, MOST_SUBDOMAINS + 1))}
    return setting.compared(setting.solved(document))


def influence_columns(setting: Setting) -> Compared:
    """Columns of influence that begin anew after two changed rows.  Collective."""
    own = {"feti_ksp_rtol": setting.drawn.rtol, "feti_pc_type": "influence", "feti_influence_columns": 2}
    return setting.compared(setting.solved(setting.drawn.document | {"petsc": own}))


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
    """A load without a temperature if that is never other than zero, for then phases need not expand."""
    warm = any("temperature" in load for load in transforms.waypoints(drawn.document["path"]) if isinstance(load, dict))
    return {name: value for name, value in load.items() if warm or name != "temperature"}


def _state(point: Any, plane: str) -> dict[str, float]:
    """Strains and stresses of a point by name."""
    strains, stresses = NAMES[components(plane)]
    own = dict(zip((*strains, *stresses), (*point["strain"], *point["stress"]), strict=True))
    return own | ({"temperature": point["temperature"]} if "temperature" in point else {})


def _joined(path: list[Any], legs: int, leg: int, share: float) -> list[Any]:
    """The points of a path one of whose legs is cut, without the end of its first part, as on the whole one."""
    points, cut = [], (leg + 1) / (legs + 1)
    for point in path:
        place = point["load_factor"] * (legs + 1)
        if abs(point["load_factor"] - cut) < 1e-12 and not point["broke"]:
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
    pairs = [{"angle": [{k: v for k, v in side[key].items() if k not in lost} for key in ends]}
             for side in (ours, theirs)]  # fmt: skip
    return Compared(*max(apart(*pairs)), "ends of legs, after a snap-back")


def resume(setting: Setting) -> Compared:
    """A path that ends at a random event and goes on from there.  Collective."""
    events = len(setting.base["path"])
    last = int(setting.rng.integers(events))
    write = Checkpoint.write

    def written(checkpoint: Checkpoint, number: int, *arrays: Any) -> None:
        write(checkpoint, number, *arrays)
        if number == last:
            raise Killed(f"at event {number}")

    with mock.patch.object(Checkpoint, "write", written):
        try:
            setting.solved(setting.drawn.document, out=setting.work)
        except Killed:
            pass
    other = setting.solved(setting.drawn.document, out=setting.work, resume=True)
    if other["resumed"] != last + 1:
        return Compared(comparison.DIFFERENT, f"resumed = {other['resumed']}, not {last + 1}")
    return setting.compared(other)


def stress_back(setting: Setting) -> Compared:
    """The strain under the stress that a strain gave.  Collective."""
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
    """A strain, the stress under it, and of an analysis of angles the last of these."""
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
    """The interfaces whose arcs have this opening."""
    if isinstance(interface, list):
        return [_with_angles(section, angle) for section in interface]
    return interface | {"debonded": [arc | {"angle": angle} for arc in interface["debonded"]]}


def onset(setting: Setting) -> Compared:
    """The first break of a path along a direction of an envelope.  Collective."""
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
    document |= {"path": {"waypoints": [*way, ray], "max_events": 100_000}}
    document["analysis"] = document["analysis"] | {"type": "path"}
    first = _first_break(setting, document)
    if first is None:
        return Compared(comparison.DIFFERENT, "no bond breaks on the path")
    legs = len(way) + 1
    found = {"factor": FAR * point["factor"] * (first["load_factor"] * legs - len(way))}
    both = [[own | {"factor": x["factor"]} for own in [{k: p[k] for k in ("strain", "stress")}]]
            for x, p in ((point, point), (found, first))]  # fmt: skip
    return Compared(*max(envelopes_apart(*both)))


def _first_break(setting: Setting, document: Document) -> Any:
    """The point of a path at which the first bond breaks."""
    other = setting.solved(document)
    return next((point for point in other["path"] if point["broke"]), None)


def certificate(setting: Setting) -> Compared:
    """`verify` of the files: the largest error of a law / its limit."""
    found = verify(setting.files)
    if not found.holds:
        return Compared(comparison.DIFFERENT, "; ".join(f.line() for f in found.findings if not f.holds))
    return Compared(0.0, "every law holds")


def solved_anew(setting: Setting) -> Compared:
    """States of the files against a solve by SciPy."""
    cell = SolvedAnew(setting.files)
    count = len(cell.file.get("state", ()))
    numbers = np.unique(np.linspace(0, count - 1, min(count, STATES)).round().astype(int)) if count else []
    found = [(off, f"{name} of state {number}") for number in map(int, numbers)
             for name, off in vars(cell.compare(number)).items()]  # fmt: skip
    cell.file.close()
    return Compared(*max(found, default=(0.0, "no state")))


Applies = Callable[[Drawn, Any], bool]


def _always(drawn: Drawn, base: Any) -> bool:
    return True


def _is_path(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis == "path"


def _is_path_of_events(drawn: Drawn, base: Any) -> bool:
    return _is_path(drawn, base) and drawn.document["path"].get("method") != "increments"


def _has_interface(drawn: Drawn, base: Any) -> bool:
    return "interface" in drawn.document


def _is_linear(drawn: Drawn, base: Any) -> bool:
    # Meshes of the program are finer at the tips of all angles than at those of one.
    return drawn.analysis in ("stiffness", "load") or (drawn.analysis == "angle" and "file" in drawn.document["cell"])


def _is_envelope(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis == "envelope"


@dataclass(frozen=True)
class Relation:
    """A relation, the cases that have it, and its tolerance: so many times that of the solver, at least `least`.

    Of those that cost a solve `weight` says how often they are drawn; the others, of weight 0, are always tried.
    """

    name: str
    check: Callable[[Setting], Compared]
    applies: Applies
    weight: float
    share: float
    least: float
    refusals: tuple[type[Exception], ...] = ()

    def tolerance(self, rtol: float) -> float:
        """The largest deviation that holds."""
        return max(self.share * rtol, self.least)


ALWAYS = (
    Relation("verify", certificate, _always, 0, 0.0, 0.0),
    Relation("solved anew by SciPy", solved_anew, _always, 0, 1e3, 1e-7),
)
RANKS = Relation("ranks", ranks, _always, 0, 1e3, 1e-7)
DRAWN = (
    Relation("unit of stress", unit_of_stress, _always, 1, 1e3, 1e-7),
    Relation("unit of length", unit_of_length, _always, 1, 1e3, 1e-7),
    Relation("order of input", order_of_input, _always, 1, 1e3, 1e-7),
    Relation("pieces", pieces, _always, 1, 1e3, 1e-7),
    Relation("influence columns", influence_columns, _has_interface, 1, 1e3, 1e-7),
    Relation("split way", split_way, _is_path_of_events, 2, 1e3, 1e-7),
    Relation("resume", resume, _is_path, 2, 1e3, 1e-7),
    Relation("stress back", stress_back, _is_linear, 1, 1e3, 1e-7, (NotCarriedError,)),
    Relation("onset", onset, _is_envelope, 2, 1e3, 1e-7),
)
