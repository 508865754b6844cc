"""What the cases of a sweep come to: a table of inputs and outputs, and its statistics over realisations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import t as student

from feti_homog.mechanics import response
from feti_homog.mechanics.voigt import STIFFNESSES, STRESSES
from feti_homog.output.text import point_tables
from feti_homog.typing import Float

Document = Mapping[str, Any]

CONFIDENCE = 0.95
GRID = 401  # strains at which curves are averaged


@dataclass(frozen=True)
class Statistics:
    """Over the realisations that are done, (points, ...): `ci95` is half the width of the 95 % confidence interval of
    the mean by Student's t; it and `std` are NaN of fewer than two."""

    count: Float
    mean: Float
    std: Float
    ci95: Float

    @classmethod
    def of(cls, samples: Float) -> Statistics:
        """Over the first axis of samples (n, ...), without those that are NaN."""
        known = np.isfinite(samples)
        count = known.sum(axis=0)
        several = np.where(count > 1, count, np.nan)
        mean = np.where(known, samples, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)
        std = np.sqrt(np.where(known, (samples - mean) ** 2, 0.0).sum(axis=0) / (several - 1))
        return cls(count.astype(float), mean, std, student.ppf(0.5 + CONFIDENCE / 2, several - 1) * std / several**0.5)


@dataclass(frozen=True)
class Collected:
    """The table of a sweep, with a row for each case.

    Attributes:
        name, stress_unit: of the sweep.
        folder, point, realisation, status, reason: of each case; `reason` is why it failed.
        inputs: by dotted key, of each case its value, None where the key does not vary.
        outputs: by name (cases,), NaN where there is none.
        documents: result.json of each finished case, else None.
    """

    name: str
    stress_unit: str
    folder: Sequence[str]
    point: Sequence[int]
    realisation: Sequence[int]
    status: Sequence[str]
    reason: Sequence[str]
    inputs: Mapping[str, Sequence[Any]]
    outputs: Mapping[str, Float]
    documents: Sequence[Document | None]

    @cached_property
    def points(self) -> list[int]:
        """The numbers of the points."""
        return sorted(set(self.point))

    def rows(self, point: int) -> list[int]:
        """The rows of the realisations of a point."""
        return [row for row, number in enumerate(self.point) if number == point]

    @cached_property
    def statistics(self) -> dict[str, Statistics]:
        """By output, over the realisations of each point."""
        return {name: self._statistics(values) for name, values in self.outputs.items()}

    def _statistics(self, values: Float) -> Statistics:
        found = [Statistics.of(values[self.rows(point)]) for point in self.points]
        return Statistics(*(np.array([getattr(s, part) for s in found]) for part in ("count", "mean", "std", "ci95")))

    def label(self, point: int, without: Sequence[str] = ()) -> str:
        """The inputs of a point in words, but for some keys and for what its realisations differ by."""
        row = self.rows(point)[0]
        keys = [name for name in self.inputs if name not in without and name != "cell.seed"]
        varied = [name for name in keys if len({repr(value) for value in self.inputs[name]}) > 1]
        values = [(name.rpartition(".")[2], self.inputs[name][row]) for name in varied]
        return ", ".join(_worded(name.replace("_", " "), value) for name, value in values if value is not None)

    def bundle(self, point: int) -> tuple[Float, Float]:
        """Strains (GRID,) and the stresses S11, S22, S12 of each finished realisation there, (n, GRID, 3).

        Both are empty if the cases are no straight paths.
        """
        documents = [document for document in (self.documents[row] for row in self.rows(point)) if document is not None]
        paths = [path for path in map(response.rising_strain, documents) if path is not None]
        if not paths:
            return np.zeros(0), np.zeros((0, 0, 3))
        strain = np.linspace(0.0, min(path[-1, 3] for path in paths), GRID)
        return strain, np.array([[np.interp(strain, p[:, 3], p[:, k]) for k in range(3)] for p in paths]).swapaxes(1, 2)


def _worded(name: str, value: Any) -> str:
    if name == "fibres":
        return f"{value} fibres"
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{name} {value:g}"
    return value if isinstance(value, str) else f"{name} {value}"


def outputs(document: Document) -> dict[str, float]:
    """The numbers of a result.json by the names of the table's columns."""
    cell, solver = document["cell"], document["solver"]
    found = {"fraction_meshed": cell["fibre_fraction"], "elements": cell["elements"], "nodes": cell["nodes"]}
    found |= {name: solver[name] for name in ("ranks", "subdomains", "dofs", "multipliers")}
    found |= {"iterations": sum(solver["iterations"])}
    for name, suffix in (("effective_stiffness", ""), ("effective_stiffness_compression", "_compression")):
        entries = np.ravel(document.get(name, [])).tolist()
        found |= {f"{entry}{suffix}": value for entry, value in zip(STIFFNESSES, entries, strict=False)}
    found |= _anisotropy(document.get("effective_stiffness"))
    found |= document.get("moduli", {}) | _bounds(document.get("bounds", {}))
    found |= _angles(document.get("angle", ())) | _path(document.get("path", ()))
    found |= {f"check_{name}": error for name, error in document["checks"].items()}
    found |= {f"seconds_{stage}": took for stage, took in document["timings"].items()}
    return {name: float(value) for name, value in (found | {"memory": document["memory"]}).items()}


def _anisotropy(stiffness: Any) -> dict[str, float]:
    """Two numbers, in the unit of stress, the means of which are zero if the composite is isotropic in the plane."""
    if stiffness is None:
        return {}
    C = np.asarray(stiffness)
    return {
        "anisotropy_axial": float(C[0, 0] - C[1, 1]),
        "anisotropy_shear": float(C[2, 2] - (C[0, 0] + C[1, 1] - 2 * C[0, 1]) / 4),
    }


def _bounds(bounds: Document) -> dict[str, float]:
    sides = {f"C{i + 1}{i + 1}_{side}": bounds[side][i][i] for side in ("reuss", "voigt") if bounds for i in range(3)}
    for modulus, pair in ((bounds.get("hashin_shtrikman") or {}) if bounds else {}).items():
        sides |= {f"{modulus}_lower": pair[0], f"{modulus}_upper": pair[1]}
    return sides


def _angles(points: Sequence[Document]) -> dict[str, float]:
    found: dict[str, float] = {}
    for point in points:
        names, key = (STIFFNESSES, "stiffness") if "stiffness" in point else (STRESSES, "stress")
        values = np.ravel(point[key]).tolist()
        found |= {f"angle_{point['angle']:g}_{name}": v for name, v in zip(names, values, strict=True)}
    return found


def _path(points: Sequence[Document]) -> dict[str, float]:
    """The first break, the largest stresses and the end."""
    if not points:
        return {}
    stress = np.array([point["stress"] for point in points])
    peak = stress[np.abs(stress).argmax(axis=0), range(3)]
    found = {"onset_load_factor": points[0]["load_factor"], "dissipated": points[-1]["dissipated"]}
    for place, values in (("onset", stress[0]), ("peak", peak), ("end", stress[-1])):
        found |= {f"{place}_{name}": value for name, value in zip(STRESSES, values.tolist(), strict=True)}
    return found | {f"end_{state}": points[-1][state] for state in point_tables.STATES}
