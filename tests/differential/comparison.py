"""How far the numbers of two results are apart, each relative to the largest of its kind in the result.

Kinds are the paths of `schema_keys`: `path[].stress` are the stresses of all points.  What a result says of its solver
is not compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.result import schema_keys

LEFT_OUT = {
    "schema", "version", "case", "digest", "solver", "checks", "check_tolerance", "kkt_tolerance", "warnings",
    "remarks", "states", "resumed", "result_h5", "timings", "memory", "checksum", "path", "envelope",
}  # fmt: skip
# Numbers of the solver, or of pieces; a ratio of two others.
LEFT_OUT_WITHIN = {"iterations", "nodes", "dissipation_ratio"}
ENERGIES = {"stored", "stored_in_springs", "work", "dissipated", "dissipated_strain_controlled", "fracture_energy"}
RATES = {"G", "G_I", "G_II"}
DIRECTIONS = {"angle", "bond_angle"}  # of a circle, where they are those of a tip or a bond
COUNTS = {"broke", "bonded", "open", "closed", "free_motions", "fibre", "interface", "number", "elements"}
# Modes of tips whose rate is a smaller share of the largest are noise.
LEAST_RATE = 1e-4
# Exponents of the units of stress and length.
UNITS = {
    "": (0, 0), "degrees": (0, 0), "1 / temperature": (0, 0),
    "unit of the cell": (0, 1), "unit of the cell squared": (0, 2),
    "unit of the moduli": (1, 0), "1 / unit of the moduli": (-1, 0),
    "unit of the moduli per unit of temperature": (1, 0),
    "unit of the moduli times that of the cell": (1, 1),
}  # fmt: skip
DIFFERENT = math.inf  # deviation of counts and words

Document = Mapping[str, Any]


def units_of_keys() -> dict[str, tuple[int, int]]:
    """Exponents of the units of stress and length of each key of result.json.  Raises KeyError for a new unit."""
    return {key.path: UNITS[key.unit] for key in schema_keys() if not key.path.startswith(("timings", "memory"))
            and not key.path.startswith("result_h5")}  # fmt: skip


def in_units(document: Any, stress: float, length: float, path: str = "") -> Any:
    """A result whose numbers are those of other units: of a stress that was 1 the number is now `stress`."""
    if not path:
        axes = document["case"].get("envelope", {}).get("plane", ("E",))
        of_stress = axes[0].startswith("S")
        kept = {name: value for name, value in document.items() if name in LEFT_OUT - {"path", "envelope"}}
        rest = {name: value for name, value in document.items() if name not in kept}
        scaled = {name: in_units(value, stress, length, name) for name, value in rest.items()}
        if of_stress:
            scaled["envelope"] = [p | ({"factor": p["factor"] * stress} if "factor" in p else {})
                                  for p in scaled["envelope"]]  # fmt: skip
        return kept | scaled
    if isinstance(document, Mapping):
        return {name: in_units(value, stress, length, f"{path}.{name}") for name, value in document.items()}
    if isinstance(document, list | tuple) and document and isinstance(document[0], Mapping):
        return [in_units(value, stress, length, f"{path}[]") for value in document]
    if isinstance(document, str | bool) or document is None:
        return document
    a, b = _UNITS_OF_KEYS.get(path, (0, 0))
    if (a, b) == (0, 0):
        return document
    return (np.asarray(document, float) * stress**a * length**b).tolist()


_UNITS_OF_KEYS = units_of_keys()


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The numbers, arrays and texts of a document with their paths, in order."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            if not (path == "" and name in LEFT_OUT) and name not in LEFT_OUT_WITHIN:
                yield from leaves(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
        for item in value:
            yield from leaves(item, f"{path}[]")
    elif value is not None:
        yield path, value


def apart(base: Any, other: Any) -> list[tuple[float, str]]:
    """The deviation of each kind of number, and its path; inf where counts, words or shapes differ."""
    sides = [_kinds(leaves(document)) for document in (base, other)]
    found = [(DIFFERENT, f"{path} in one of them") for path in sides[0].keys() ^ sides[1].keys()]
    sizes = _sizes(sides[0])
    for path in sides[0].keys() & sides[1].keys():
        found.append((_deviation(path, sides[0], sides[1], sizes), path))
    return found


def _kinds(items: Iterable[tuple[str, Any]]) -> dict[str, list[Any]]:
    kinds: dict[str, list[Any]] = {}
    for path, value in items:
        kinds.setdefault(path, []).append(value)
    return kinds


def group(path: str) -> str:
    """Numbers of one group are measured by the largest of them all."""
    record, _, name = path.rpartition(".")
    for number, names in enumerate((ENERGIES, RATES)):
        if name in names:
            return f"{record} {number}"
    return path


def _in_words(value: Any) -> bool:
    return isinstance(value, str | bool) or (isinstance(value, list) and any(isinstance(item, str) for item in value))


def _sizes(kinds: Mapping[str, Sequence[Any]]) -> dict[str, float]:
    sizes: dict[str, float] = {}
    for path, values in kinds.items():
        if not any(map(_in_words, values)):
            largest = max(np.abs(np.asarray(value, float)).max(initial=0.0) for value in values)
            sizes[group(path)] = max(sizes.get(group(path), 0.0), float(largest))
    return sizes


def _deviation(path: str, base: Any, other: Any, sizes: Mapping[str, float]) -> float:
    ours, theirs = base[path], other[path]
    record, _, name = path.rpartition(".")
    if any(map(_in_words, ours)):
        return 0.0 if ours == theirs else DIFFERENT
    shapes = [[np.shape(value) for value in values] for values in (ours, theirs)]
    if shapes[0] != shapes[1]:
        return DIFFERENT
    a, b = (np.concatenate([np.ravel(np.asarray(v, float)) for v in values]) for values in (ours, theirs))
    if name in COUNTS and not record.endswith("fractions"):  # of phases, which may be fibres
        return 0.0 if np.array_equal(a, b) else DIFFERENT
    off = np.abs(a - b)
    if name in DIRECTIONS or name == "psi":
        off = np.minimum(off % 360, -off % 360) / 360
    if name == "psi":
        rates = sum(np.concatenate([np.ravel(v) for v in base[f"{record}.{G}"]]) for G in ("G_I", "G_II"))
        off = off * np.minimum(rates / (LEAST_RATE * sizes[group(f"{record}.G_I")] or 1.0), 1.0) ** 4
    size = 1.0 if name in DIRECTIONS or name == "psi" else sizes[group(path)]
    if not len(off):
        return 0.0
    largest = float(off.max()) if np.isfinite(off).all() else DIFFERENT
    return largest / size if size else (0.0 if largest == 0.0 else DIFFERENT)


def envelopes_apart(base: Sequence[Document], other: Sequence[Document]) -> list[tuple[float, str]]:
    """The same of envelopes: loads at onset by their inverses, which are linear in what tractions use of their strength.

    Which bond breaks first is not compared: those of symmetric cells tie.
    """
    if [p.get("factor") is None for p in base] != [p.get("factor") is None for p in other]:
        return [(DIFFERENT, "envelope[].factor in one of them")]
    pairs = [(a, b) for a, b in zip(base, other, strict=True) if a.get("factor") is not None]
    least = min((a["factor"] for a, _ in pairs), default=0.0)
    found = [(0.0, "envelope[].factor")]
    for a, b in pairs:
        weight = least / a["factor"] if a["factor"] else 1.0
        for name in ("factor", "strain", "stress"):
            x, y = (np.atleast_1d(np.asarray(p[name], float)) for p in (a, b))
            size = np.abs(x).max()
            off = np.abs(x - y).max()
            found.append((weight * off / size if size else off, f"envelope[].{name}"))
    return found
