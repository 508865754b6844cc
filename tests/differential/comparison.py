"""Compare the numbers of two results, each relative to the largest of its kind in the result.

Kinds are the paths of `schema_keys`: `path[].stress` are the stresses of all points.  What a result holds of its solver
is not compared.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

# What follows from the path, whose events are compared by their loads: `peak` has their numbers.
LEFT_OUT = {
    "schema", "version", "date", "case", "digest", "solver", "checks", "check_tolerance", "kkt_tolerance", "warnings",
    "remarks", "states", "resumed", "result_h5", "timings", "memory", "checksum", "path", "peak",
    "envelope",
}  # fmt: skip
# Numbers of the solver, or of pieces; a ratio of two others; which point is the peak, as above; the positions of the
# largest stresses and modes of failure, several of which may tie.
LEFT_OUT_WITHIN = {
    "iterations", "nodes", "dissipation_ratio", "mark", "principal_at", "von_mises_at", "hydrostatic_at",
    "utilisation_at", "mode",
}  # fmt: skip
ENERGIES = {
    "stored", "stored_in_springs", "work", "dissipated", "dissipated_strain_controlled", "fracture_energy",
    "friction_heat",
}  # fmt: skip
RATES = {"G", "G_I", "G_II", "G_III"}
STRESSES = {"principal", "von_mises", "hydrostatic"}
DIRECTIONS = {"angle", "bond_angle", "psi"}
COUNTS = {"broke", "softened", "bonded", "open", "closed", "free_motions", "fibre", "interface", "number", "elements"}
TOUCHING = {"open", "closed"}
PLACES = {"fibres[].centre", "cell.origin"}  # on the torus
# Of moduli, measured by 1: they may vanish.
RATIOS = {
    "eta1", "eta2", "deviation", "anisotropy", "nu12", "nu21", "nu13", "nu23", "nu31", "nu32", "nu_axial",
    "nu_transverse",
}  # fmt: skip
# Modes of tips are less sure where the rate is a smaller share of the largest.
LEAST_RATE = 1e-2
DIFFERENT = math.inf  # deviation of counts and words

Kinds = Mapping[str, Sequence[Any]]


def apart(base: Any, other: Any) -> list[tuple[float, str]]:
    """Return the deviation of each kind of number, and its path; inf where counts, words or shapes differ."""
    ours, theirs = (_kinds(document) for document in _with_phases(base, other))
    found = [(DIFFERENT, f"{path} in one of them") for path in ours.keys() ^ theirs.keys()]
    sizes = _sizes(ours)
    return found + [(_deviation(path, ours, theirs, sizes), path) for path in ours.keys() & theirs.keys()]


def _with_phases(*documents: Any) -> list[Any]:
    """Sort stresses of phases by name; leave them out where one result has none, and of the chosen states of paths."""
    name = "phase_stresses"
    if "path" in documents[0] or not all(document.get(name) for document in documents):
        return [{key: value for key, value in document.items() if key != name} for document in documents]
    return [document | {name: sorted(document[name], key=lambda phase: phase["phase"])} for document in documents]


def _kinds(document: Any) -> dict[str, list[Any]]:
    kinds: dict[str, list[Any]] = {}
    for path, value in leaves({name: v for name, v in document.items() if name not in LEFT_OUT}):
        kinds.setdefault(path, []).append(value)
    return kinds


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers, arrays and texts of a document with their paths, in order."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            if name not in LEFT_OUT_WITHIN:
                yield from leaves(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for item in value:
            yield from leaves(item, f"{path}[]")
    elif value is not None:
        yield path, value


def group(path: str) -> str:
    """Numbers of one group are measured by the largest of them all."""
    record, _, name = path.rpartition(".")
    return next((f"{record}: {names}" for names in (ENERGIES, RATES, STRESSES) if name in names), path)


def _in_words(values: Sequence[Any]) -> bool:
    return any(isinstance(item, str | bool) for value in values for item in np.ravel(np.asarray(value, object)))


def _sizes(kinds: Kinds) -> dict[str, float]:
    sizes: dict[str, float] = {}
    for path, values in kinds.items():
        if not _in_words(values):
            sizes[group(path)] = max(sizes.get(group(path), 0.0), float(np.abs(_flat(values)).max(initial=0.0)))
    return sizes


def _flat(values: Sequence[Any]) -> np.ndarray:
    return np.concatenate([np.ravel(np.asarray(value, float)) for value in values])


def _deviation(path: str, base: Kinds, other: Kinds, sizes: Mapping[str, float]) -> float:
    """Compute the deviation of one kind of number; of directions and modes the share of a circle."""
    record, _, name = path.rpartition(".")
    ours, theirs = base[path], other[path]
    if [np.shape(value) for value in ours] != [np.shape(value) for value in theirs]:
        return DIFFERENT
    if name in TOUCHING and f"{record}.friction_heat" in base:
        # With friction a free fibre stays where its last contact leaves it, one of many places if several end at once.
        held = [number == 0 for number in base[f"{record}.free_motions"]]
        ours, theirs = ([n for n, is_held in zip(values, held, strict=True) if is_held] for values in (ours, theirs))
    # Phases may have the name of a count.
    if _in_words(ours) or (name in COUNTS and not record.endswith("fractions")):
        return 0.0 if ours == theirs else DIFFERENT
    a, b = _flat(ours), _flat(theirs)
    off = np.abs(a - b)
    if path in PLACES:
        share = off.reshape(-1, 2) / _flat([base["cell.width"], base["cell.height"]])
        return _largest(np.minimum(share % 1.0, -share % 1.0), 1.0)
    if name in DIRECTIONS:
        off = np.minimum(off % 360, -off % 360) / 360 * _certainty(record, name, base, sizes)
        return _largest(off, 1.0)
    return _largest(off, max(sizes[group(path)], 1.0) if name in RATIOS else sizes[group(path)])


def _certainty(record: str, name: str, base: Kinds, sizes: Mapping[str, float]) -> Any:
    """Weight the modes of tips by their rates: a mode is a ratio of rates."""
    if name != "psi" or f"{record}.G_I" not in base:
        return 1.0
    rates = sum(_flat(base[f"{record}.{mode}"]) for mode in ("G_I", "G_II", "G_III") if f"{record}.{mode}" in base)
    return np.minimum(np.abs(rates) / (LEAST_RATE * sizes[group(f"{record}.G_I")] or 1.0), 1.0)


def _largest(off: np.ndarray, size: float) -> float:
    """Return the largest of the differences `off` / size, where 0 / 0 = 0."""
    largest = float(off.max(initial=0.0))
    if not np.isfinite(off).all() or (largest > 0.0 and size == 0.0):
        return DIFFERENT
    return largest / size if size else 0.0


def envelopes_apart(base: Sequence[Any], other: Sequence[Any]) -> list[tuple[float, str]]:
    """Compare envelopes: loads at onset by their inverses, which are linear in the share of the strength in use.

    Which bond breaks first is not compared: those of symmetric cells tie.
    """
    if [point.get("factor") is None for point in base] != [point.get("factor") is None for point in other]:
        return [(DIFFERENT, "envelope[].factor in one of them")]
    pairs = [(a, b) for a, b in zip(base, other, strict=True) if a.get("factor") is not None]
    least = min((a["factor"] for a, _ in pairs), default=0.0)
    found = [(0.0, "envelope[].factor")]
    for a, b in pairs:
        weight = least / a["factor"] if a["factor"] else 1.0
        for name in ("factor", "strain", "stress"):
            x, y = (np.atleast_1d(np.asarray(point[name], float)) for point in (a, b))
            found.append((weight * _largest(np.abs(x - y), float(np.abs(x).max())), f"envelope[].{name}"))
    return found
