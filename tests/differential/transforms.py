"""Equal cases in other words: in other units, in another order, with a path cut in two."""

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from support.dimensions import Units

from differential.random_cells import MESH
from differential.random_loads import NAMES, components
from differential.random_phases import Document


def in_units(document: Document, units: Units) -> Document:
    """Return a case in other units."""
    scaled = units.case(document)
    if not document["cell"].keys() & {"width", "fibre_radius", "file"}:
        scaled["cell"]["width"] = units.length  # of 1, the default
    return scaled


def scale_mesh(source: Path, target: Path, length: float) -> None:
    """Write the mesh of a folder to another one, `length` times as large."""
    lines = (source / MESH).read_text().splitlines()
    first = lines.index("$Nodes") + 2
    for row in range(first, first + int(lines[first - 1])):
        number, x, y, z = lines[row].split()
        lines[row] = f"{number} {float(x) * length!r} {float(y) * length!r} {z}"
    (target / MESH).write_text("\n".join([*lines, ""]))


def sections(document: Mapping[str, Any]) -> list[Document]:
    """Return the sections of interfaces."""
    given = document.get("interface", [])
    return given if isinstance(given, list) else [given]


class Places(NamedTuple):
    """The places, from 0, that fibres, rows of the table and sections of interfaces had; empty where they stay."""

    fibres: list[int]
    rows: list[int]
    sections: list[int]


def reordered(rng: np.random.Generator, document: Document) -> tuple[Document, Places]:
    """Return the case with keys, fibres, arcs and sections of interfaces in another order, and their former places."""
    case = copy.deepcopy(document)
    scattered = any("scatter" in section for section in sections(case))
    fibres, rows = _shuffled_rows(rng, case["cell"], scattered)
    for section in sections(case):
        if "between" in section:
            section["between"] = section["between"][::-1]
        arcs = section.get("debonded", [])
        for arc in arcs:
            if fibres and arc["fibre"] != "all":
                arc["fibre"] = fibres.index(arc["fibre"] - 1) + 1
        if arcs:
            section["debonded"] = [arcs[k] for k in rng.permutation(len(arcs))]
    order = rng.permutation(len(sections(case))).tolist()
    if len(order) > 1:
        case["interface"] = [case["interface"][k] for k in order]
    return _reversed_keys(case), Places(fibres, rows, order)


def _shuffled_rows(rng: np.random.Generator, cell: Document, scattered: bool) -> tuple[list[int], list[int]]:
    """Reorder the rows of a table; return the former numbers of fibres and of rows, from 0.

    Strengths that are drawn belong to the numbers: such rows keep their order.
    """
    rows = [] if scattered else cell.get("fibre_list", [])
    order = rng.permutation(len(rows)).tolist()
    if rows:
        cell["fibre_list"] = [rows[k] for k in order]
    solid = [k for k, row in enumerate(rows) if row.get("phase") != "void"]
    return [solid.index(k) for k in order if k in solid], order


def _reversed_keys(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _reversed_keys(v) for k, v in reversed(value.items())}
    return [_reversed_keys(item) for item in value] if isinstance(value, list) else value


def relabelled(result: Any, places: Places) -> Any:
    """Return a result of `reordered` whose fibres, rows and sections have the numbers that they had."""
    if isinstance(result, list):
        return [relabelled(item, places) for item in result]
    if not isinstance(result, Mapping):
        return result
    found, (fibres, _, order) = {k: relabelled(v, places) for k, v in result.items()}, places
    for name, own in (("debonded_length", fibres), ("debonding_angle", fibres), ("debonded_shares", order)):
        if name in found and own:
            found[name] = [found[name][k] for k in np.argsort(own)]
    if "solver" in found:  # the whole result
        found["fibres"] = _renumbered(found["fibres"], places)
    return _relabelled_tips(found, fibres, order) if "G_I" in found else found


def _renumbered(fibres: Sequence[Document], places: Places) -> list[Document]:
    records = [fibres[k] for k in np.argsort(places.fibres)] if places.fibres else fibres
    if places.rows:
        records = [record | {"row": places.rows[record["row"] - 1] + 1} for record in records]
    return [record | {"number": number} for number, record in enumerate(records, 1)]


def _relabelled_tips(tips: Document, fibres: Sequence[int], order: Sequence[int]) -> Document:
    """Return the tips in the order of load, fibre, section, and within these as they are."""
    own = {"fibre": [fibres[f - 1] + 1 if fibres else f for f in tips["fibre"]]}
    if "interface" in tips:
        own["interface"] = [order[i - 1] + 1 for i in tips["interface"]]
    seen = {name: k for k, name in enumerate(dict.fromkeys(tips.get("load", [])))}
    loads = [[seen[name] for name in tips["load"]]] if "load" in tips else []
    columns = [*loads, *own.values()]
    rows = sorted(range(len(own["fibre"])), key=lambda k: [column[k] for column in columns])
    return {name: [values[k] for k in rows] for name, values in (tips | own).items()}


def full(load: Any, before: Mapping[str, float], plane: str, expands: bool) -> dict[str, float]:
    """Return a load of a path with a value of every component, given strain or stress; `before` is the one before."""
    strains, stresses = NAMES[components(plane)]
    named = dict(zip(strains, load, strict=True)) if isinstance(load, list) else dict(load)
    result = dict(before) or dict.fromkeys(stresses, 0.0)
    for strain, stress in zip(strains, stresses, strict=True):
        for name, other in ((strain, stress), (stress, strain)):
            if name in named:
                result.pop(other, None)
                result[name] = named[name]
    if expands:
        result["temperature"] = named.get("temperature", before.get("temperature", 0.0))
    return result


def waypoints(path: Mapping[str, Any]) -> list[Any]:
    """Return the loads of a section [path]."""
    return list(path["waypoints"]) if "waypoints" in path else [path["strain"] if "strain" in path else path["to"]]


def between(begin: Mapping[str, float], end: Mapping[str, float], share: float) -> dict[str, float]:
    """Return the load after a share of the way to `end`; `begin` has strains and stresses of all components."""
    return {name: (1 - share) * begin.get(name, 0.0) + share * value for name, value in end.items()}
