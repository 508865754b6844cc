"""Read the uncertain numbers of a case, written KEY = {mean, std} or {mean, cv}, and their correlation."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.case import sections, toml_files
from feti_homog.schema import types, wording
from feti_homog.typing import Float

STIFFNESS = "stiffness"
SECTIONS = ("material", "interface")
EXPECTED = "expected {mean, std} or {mean, cv}, numbers, std and cv above 0"


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of p uncertain numbers by dotted key, and correlations as (key, key, value)."""

    std: Mapping[str, float]
    correlation: tuple[tuple[str, str, float], ...] = ()

    def matrix(self) -> Float:
        """Return the correlation matrix (p, p) of the numbers, in the order of `std`."""
        names, result = [*self.std], np.eye(len(self.std))
        for first, second, value in self.correlation:
            i, j = names.index(first), names.index(second)
            result[i, j] = result[j, i] = value
        return result

    def propagated(self, J: Float) -> tuple[Float, Float]:
        """Propagate the covariance V of the numbers to n results with derivatives J (n, p), to first order.

        Returns the standard deviations (n,) of the results, and the fraction (n, p) of each variance that each number
        contributes.  The variances are the diagonal of J V J^T; number k adds J_k (V J^T)_k, which may be negative.
        """
        A = J * np.array([*self.std.values()])  # change of the results per standard deviation
        scale = np.abs(A).max(axis=1, initial=np.finfo(float).tiny)  # so that no square over- or underflows
        A = A / scale[:, None]
        parts = A * (A @ self.matrix())
        variance = np.maximum(parts.sum(axis=1), 0.0)
        shares = np.divide(parts, variance[:, None], out=np.zeros_like(parts), where=variance[:, None] > 0)
        return scale * np.sqrt(variance), shares

    def to_table(self) -> dict[str, Any]:
        """Return the section [uncertainty] for a document in which the uncertain numbers are means."""
        pairs = {sections.CORRELATION: [list(pair) for pair in self.correlation]} if self.correlation else {}
        return {**self.std, **pairs}


def read_uncertainty(document: dict[str, Any], faults: list[str]) -> Uncertainty:
    """Extract the uncertain numbers of a document, and replace them there by their means.

    Removes [uncertainty].  Faults add lines to `faults`; the result then has no numbers, or impossible correlations.
    """
    section = sections.UNCERTAINTY
    table = document.pop(section, {})
    if not isinstance(table, dict):
        faults.append(f"{section} = {wording.toml_value(table)}: expected a section [{section}]")
        return Uncertainty({})
    stds = toml_files.leaves({name: value for name, value in table.items() if name != sections.CORRELATION})
    given = [(path, value) for path, value in stds if value != {}]
    for name in document:
        document[name] = _means(document[name], (name,), given, faults)
    if len(given) > types.MOST_SECTIONS:
        faults.append(f"[{section}]: {len(given)} uncertain numbers; expected at most {types.MOST_SECTIONS}")
        return Uncertainty({})
    paths, named = [path for path, _ in given], {".".join(path): value for path, value in given}
    for path, value in dict(given).items():
        name = f"[{section}] {wording.dotted_key(path)}"
        if paths.count(path) > 1:
            faults.append(f"{name}: its standard deviation is given twice")
        if not types.is_number(value) or value <= 0:
            words = f"expected a standard deviation above 0{types.hint(value)}"
            faults.append(f"{name} = {wording.toml_value(value)}: {words}")
        elif number_at(document, path) is None:
            hint = f"; write {wording.dotted_key(path[:-1])} = {value:g}" if path[-1] == "std" else ""
            faults.append(f"{name}: expected a key of the case whose value is a number{hint}")
        elif path[0] == "material" and path[2:3] == ("strength",) and "load" not in document:
            faults.append(f"{name}: only the utilisation under a [load] depends on it; expected a number alone")
    pairs = table.get(sections.CORRELATION, [])
    faults += _pair_faults(pairs, named)
    if faults:
        return Uncertainty({})
    result = Uncertainty(named, tuple((first, second, float(value)) for first, second, value in pairs))
    # The rounding error of an eigenvalue is at most n eps times the norm, which is at most the order n.
    if named and np.linalg.eigvalsh(result.matrix()).min() < -(len(named) ** 2) * np.finfo(float).eps:
        place = f"[{section}] {sections.CORRELATION}"
        faults.append(f"{place}: these correlations are impossible; expected a positive semidefinite matrix")
    return result


def _pair_faults(pairs: Any, named: Mapping[str, Any]) -> Iterator[str]:
    """Yield the faults in the list `pairs` of correlations between the numbers `named`."""
    words = f"expected [KEY, KEY, VALUE] of two uncertain constants, {' and '.join(named)}, from -1 to 1"
    known = set[frozenset[str]]()
    for pair in pairs if isinstance(pairs, list) else [pairs]:
        is_triple = isinstance(pair, list) and len(pair) == 3
        names = frozenset(map(str, pair[:2])) if is_triple else frozenset[str]()
        place = f"[{sections.UNCERTAINTY}] {sections.CORRELATION} = {wording.toml_value(pair)}"
        if len(names & named.keys()) != 2 or not types.is_number(pair[2]) or abs(pair[2]) > 1:
            yield f"{place}: {words}"
        elif names in known:
            yield f"{place}: this pair is given twice"
        else:
            known.add(names)


def _means(
    value: Any, path: toml_files.TomlPath, given: list[tuple[toml_files.TomlPath, Any]], faults: list[str]
) -> Any:
    """Return a value with means for uncertain numbers; append (path, deviation) to `given`, lines to `faults`."""
    if isinstance(value, list):
        numbers = [()] if len(value) == 1 else [(str(k + 1),) for k in range(len(value))]
        return [_means(item, (*path, *number), given, faults) for item, number in zip(value, numbers, strict=True)]
    if not isinstance(value, dict):
        return value
    if "mean" not in value:
        return {name: _means(item, (*path, name), given, faults) for name, item in value.items()}
    deviation, is_entry = 0.0, path[-3:-2] == (STIFFNESS,)
    if value.keys() in ({"mean", "std"}, {"mean", "cv"}) and all(map(types.is_number, value.values())):
        deviation = float(value["std"] if "std" in value else value["cv"] * abs(value["mean"]))
    if len(path) == 1:
        faults.append(f"{path[0]} = {wording.toml_value(value)}: expected no number")
    elif not deviation > 0:
        faults.append(f"[{wording.dotted_key(path[:-1])}] {path[-1]} = {wording.toml_value(value)}: {EXPECTED}")
    elif value.get("cv", 0.0) >= 1.0:
        place = f"[{wording.dotted_key(path[:-1])}] {path[-1]}"
        faults.append(f"{place}: cv = {value['cv']:g}: expected less than 1; 5 % is 0.05")
    else:
        # Two symmetric entries of a stiffness are one number, with the name Cij, as in derivatives.
        entry = ((*path[:-2], "C" + "".join(sorted(path[-2:]))) if is_entry else path, deviation)
        if not (is_entry and entry in given):
            given.append(entry)
    return value["mean"]


def number_at(document: Mapping[str, Any], path: toml_files.TomlPath) -> float | None:
    """Return the number at a path in a document; None if there is no number, or the path fits several sections."""
    result: Any = document
    for name in toml_files.in_lists(path):
        result = result[0] if isinstance(result, list) and len(result) == 1 else result
        if isinstance(result, list):  # sections of the same name are numbered from 1
            result = {str(number): each for number, each in enumerate(result, start=1)}
        result = result.get(name) if isinstance(result, dict) else None
    return float(result) if types.is_number(result) else None
