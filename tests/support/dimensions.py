"""Physical dimensions of a case's entries and of those of result.json, and both in other units."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from manual_source.record_tables import schema_keys

from feti_homog.analysis.result import Result

# Powers of stress, length and temperature by the words that the reference of result.json has for a unit.
OF_UNITS = {
    **dict.fromkeys(("", "degrees", "s", "bytes"), (0, 0, 0)),
    "unit of the moduli": (1, 0, 0),
    "conductivity": (1, 0, 0),  # in place of moduli
    "1 / unit of the moduli": (-1, 0, 0),
    "unit of the cell": (0, 1, 0),
    "unit of the cell squared": (0, 2, 0),
    "stress times length": (1, 1, 0),
    "unit of the moduli per unit of temperature": (1, 0, -1),
    "1 / temperature": (0, 0, -1),
    "1 / unit of temperature": (0, 0, -1),
}
# The same of entries whose unit the reference leaves to the case.
OF_PATHS = {"path[].temperature": (0, 0, 1), "load.temperature": (0, 0, 1)}
# Entries of constants, whose errors have their units.
OF_CONSTANTS = {"moduli", "constants", "transversely_isotropic", "transverse_moduli"}
# What is no number of the response: where and when it was computed, and the case itself.
APART = {"case", "digest", "version", "date", "timings", "memory", "checksum", "result_h5"}

# The same of the entries of a case, by their names.
OF_CASE = {
    r"young|E\d|E_\w+|G\d\d|G_\w+|stiffness|\w+_strength|S\d\d|stress": (1, 0, 0),
    r"conductivity|axial|transverse": (1, 0, 0),
    r"(normal|tangential|axial)_stiffness|conductance": (1, -1, 0),
    r"tractions": (1, 0, 0),
    r"\w*toughness": (1, 1, 0),
    r"width|height|openings|(fibre_|inner_)?radius|x|y|a|b": (0, 1, 0),
    r"expansion\w*": (0, 0, -1),
    r"temperature": (0, 0, 1),
}
# Strains have the form of moduli there.
STRAINS = re.compile(r"E\d\d")


@dataclass(frozen=True)
class Units:
    """Factors of the numbers of each dimension."""

    stress: float = 1.0
    length: float = 1.0
    temperature: float = 1.0

    def of(self, powers: tuple[int, int, int]) -> float:
        """Return the factor of numbers with these powers of stress, length and temperature."""
        return self.stress ** powers[0] * self.length ** powers[1] * self.temperature ** powers[2]

    def case(self, document: Mapping[str, Any]) -> dict[str, Any]:
        """Return a case in these units."""
        return {name: value if name == "petsc" else self._entry(name, value) for name, value in document.items()}

    def _entry(self, name: str, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: self._entry(key, item) for key, item in value.items()}
        if isinstance(value, list):
            return [self._entry(name, item) for item in value]
        found = [powers for words, powers in OF_CASE.items() if re.fullmatch(words, name)]
        is_number = isinstance(value, float | int) and not isinstance(value, bool)
        if not is_number or not found or STRAINS.fullmatch(name):
            return value
        return value * self.of(found[0])


def numbers(result: Result) -> Iterator[tuple[str, tuple[int, int, int], np.ndarray]]:
    """Place, powers and values of all numbers of result.json that belong to the response."""
    powers, document = powers_of_keys(result.document), dict(result.document)
    # A unit of temperature is another one in other units.
    document["phase_stresses"] = [
        {
            name: np.array(column)[np.array(phase["state"]) != "temperature"]
            for name, column in phase.items()
            if len(column) == len(phase["state"])
        }
        for phase in document.get("phase_stresses", ())
    ]
    for path, value in _leaves(document, ""):
        if path.split(".")[0] not in APART:
            kind = _kind(path)
            yield path, powers[kind if kind in powers else kind.rpartition(".")[0] + ".PHASE"], value


def powers_of_keys(document: Mapping[str, Any]) -> dict[str, tuple[int, int, int]]:
    """Powers of each key of a result.json; the factor of an envelope is a stress or a strain.

    Raises KeyError for a unit that is new.
    """
    axes = document["case"].get("envelope", {}).get("plane", [""])
    factor = int(axes[0].startswith("S")), 0, 0
    powers = {key.path: OF_UNITS[key.unit] for key in schema_keys()} | OF_PATHS | {"envelope[].factor": factor}
    places = [path.split(".") for path in powers if path.count(".") == 1]
    errors = {f"mesh_error.constants.{name}": powers[f"{of}.{name}"] for of, name in places if of in OF_CONSTANTS}
    return powers | errors


def in_units(document: Mapping[str, Any], units: Units) -> dict[str, Any]:
    """Return a result.json in other units; its case stays as it is."""
    powers = powers_of_keys(document)
    return {name: v if name == "case" else _scaled(v, name, powers, units) for name, v in document.items()}


def _scaled(value: Any, path: str, powers: Mapping[str, tuple[int, int, int]], units: Units) -> Any:
    if isinstance(value, Mapping):
        return {name: _scaled(item, f"{path}.{name}", powers, units) for name, item in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return [_scaled(item, f"{path}[]", powers, units) for item in value]
    own = powers.get(path, (0, 0, 0))
    return value if not any(own) or value is None else (np.asarray(value) * units.of(own)).tolist()


def _leaves(value: Any, path: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the numbers of a document by their places; texts and what is absent are none."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from _leaves(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
        for k, item in enumerate(value):
            yield from _leaves(item, f"{path}[{k}]")
    elif value is not None:
        array = np.asarray(value)
        if array.dtype.kind in "ifb":
            yield path, array


def differences(one: Result, other: Result, units: Units) -> dict[str, float]:
    """Largest differences, by the place of each number of `other` that is not that of `one` in its units.

    They are relative to the largest number of that kind in the result, of checks absolute; inf where one of the results
    has none.
    """
    ours, theirs = ({path: (powers, v) for path, powers, v in numbers(result)} for result in (one, other))
    off, sizes = dict.fromkeys(ours.keys() ^ theirs.keys(), np.inf), {}
    for path, (_, values) in ours.items():
        sizes[_kind(path)] = max(sizes.get(_kind(path), 0.0), np.abs(values).max(initial=0.0))
    for path in ours.keys() & theirs.keys():
        expected, found = ours[path][1], theirs[path][1] / units.of(ours[path][0])
        if expected.shape != found.shape:
            off[path] = np.inf
        elif not np.array_equal(expected, found, equal_nan=True):
            size = 1.0 if path.startswith("checks.") else sizes[_kind(path)]
            off[path] = float(np.abs(found - expected).max() / size) if size else np.inf
    return off


def _kind(path: str) -> str:
    """Return a place without the numbers in lists."""
    return re.sub(r"\[\d+\]", "[]", path)
