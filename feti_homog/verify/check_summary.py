"""Laws of the numbers that result.json sums up: of the mesh, the moduli and the bounds; and of the tables beside it."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import gammaln

from feti_homog.runtime import input_files
from feti_homog.typing import Float
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import NAMES

Section = Mapping[str, Any]


def check_summary(findings: Findings, cell: DiscreteCell) -> None:
    """Check the sections `cell`, `moduli` and `bounds` of result.json, if present."""
    document = cell.files.document
    _check_cell(findings, cell, document["cell"])
    _check_fibres(findings, cell, document["fibres"])
    if document.get("moduli") is not None:
        stiffness = np.array(document["effective_stiffness"])
        for name, value in moduli(stiffness).items():
            scale = max(abs(value), 1.0) if name in ("eta1", "eta2", "anisotropy") else abs(value)
            findings.record("moduli", relative(np.array(document["moduli"][name] - value), scale), f"moduli.{name}")
    if document.get("bounds") is not None:
        _check_bounds(findings, cell, document["bounds"], np.array(document["effective_stiffness"]))


def _check_cell(findings: Findings, cell: DiscreteCell, told: Section) -> None:
    width, height = cell.files.size
    names, mesh = cell.files.phases, cell.files.mesh
    fibres = [number for number, name in enumerate(names) if name not in ("matrix", "coating")]
    expected = {"width": width, "height": height, "area": width * height, "elements": len(mesh.triangles)}
    expected |= {"porosity": cell.porosity}
    expected |= {"nodes": len(mesh.points), "fibre_fraction": float(cell.fractions[fibres].sum())}
    for name, value in expected.items():
        scale = 1.0 if name in ("fibre_fraction", "porosity") else abs(value) or 1.0
        findings.record("cell", abs(told.get(name, 0.0) - value) / scale, f"cell.{name}")
    for name, value in zip(names, cell.fractions, strict=True):
        findings.record("cell", abs(told["fractions"][name] - value), f"cell.fractions.{name}")


def _check_fibres(findings: Findings, cell: DiscreteCell, told: Sequence[Section]) -> None:
    """Check that the list of fibres is that of result.h5, in the order of their numbers."""
    fibres, phases = cell.files.fibres, cell.files.phases
    numbers = np.arange(1, len(fibres.number) + 1)
    findings.record("tables", np.where(np.array_equal(fibres.number, numbers), 0.0, np.inf), "/fibre/number")
    listed = [(fibre["number"], fibre["phase"]) for fibre in told]
    expected = [(number, phases[phase]) for number, phase in zip(numbers, fibres.phase, strict=True)]
    findings.record("tables", np.where(listed == expected, 0.0, np.inf), "fibres")
    if listed == expected:
        circles = np.array([[*fibre.get("centre", (None, None)), fibre.get("radius")] for fibre in told], float)
        circles = circles.reshape(-1, 3)  # of a cell without fibres too
        stored = np.column_stack([fibres.centre, fibres.radius])
        off = np.where(np.isnan(circles) & np.isnan(stored), 0.0, circles - stored)
        findings.record("tables", relative(off, cell.files.size.max()).max(axis=1), lambda i: f"fibres[{i}]")
        factors = np.array([fibre.get("strength", 1.0) for fibre in told]) - fibres.strength
        findings.record("tables", np.abs(factors), lambda i: f"fibres[{i}].strength")
        findings.record("tables", _unlike_scatter(cell), "/fibre/strength at fibre {}".format)


def _unlike_scatter(cell: DiscreteCell) -> Float:
    """(f,) errors of the strengths of fibres, but for those that a table may have given.

    Quantiles of Weibull's distribution with mean 1.
    """
    strength, scatter = cell.files.fibres.strength, next(iter(cell.files.interfaces), {}).get("scatter")
    if cell.files.case["cell"]["geometry"] == "table":
        return np.zeros_like(strength)
    if scatter is None:
        return np.asarray(np.abs(strength - 1.0))
    stream = np.random.default_rng(np.random.SeedSequence(scatter["seed"], spawn_key=(1,)))
    hazard, m = -np.log(1.0 - stream.random(len(strength))), scatter["shape"]
    return np.asarray(np.abs(np.log(strength) - np.log(hazard) / m + gammaln(1.0 + 1.0 / m)))


def moduli(stiffness: Float) -> dict[str, float]:
    """Engineering moduli of a stiffness (3, 3), from the strains under unit stresses."""
    strain = np.linalg.solve(stiffness, np.eye(3))
    by_s11, by_s22, by_s12 = strain.T
    bulk, shear = _isotropic_part(stiffness)
    nearest = np.array([[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]])
    return {
        "E1": 1 / by_s11[0], "E2": 1 / by_s22[1], "G12": 1 / by_s12[2],
        "nu12": -by_s11[1] / by_s11[0], "nu21": -by_s22[0] / by_s22[1],
        "eta1": by_s11[2] / by_s11[0], "eta2": by_s22[2] / by_s22[1],
        "bulk": bulk, "shear": shear, "anisotropy": np.sqrt(_square(stiffness - nearest) / _square(stiffness)),
    }  # fmt: skip


def _isotropic_part(c: Float) -> tuple[float, float]:
    """Moduli k, mu of the nearest isotropic stiffness: its invariants C_iijj / 4 and (C_ijij - C_iijj / 2) / 4."""
    spherical, full = c[0, 0] + c[1, 1] + 2 * c[0, 1], c[0, 0] + c[1, 1] + 2 * c[2, 2]
    return float(spherical / 4), float((full - spherical / 2) / 4)


def _square(c: Float) -> float:
    """C_ijkl C_ijkl."""
    index = np.array([0, 2, 2, 1])
    return float(np.square(c[index[:, None], index[None]]).sum())


def _check_bounds(findings: Findings, cell: DiscreteCell, told: Section, stiffness: Float) -> None:
    """Voigt's and Reuss' bounds, those of Hashin and Shtrikman, and the order of all."""
    upper, lower = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses), cell.reuss
    size = float(np.abs(upper).max())
    for name, bound in (("voigt", upper), ("reuss", lower)):
        findings.record("bounds", relative(np.array(told[name]) - bound, size), f"bounds.{name}")
    for place, gap in (("Voigt - L", upper - stiffness), ("L - Reuss", stiffness - lower)):
        least = float(np.linalg.eigvalsh((gap + gap.T) / 2).min())
        findings.record("bounds", max(-least, 0.0) / size, f"the least eigenvalue of {place}")
    if told["hashin_shtrikman"] is not None:
        expected = _hashin_shtrikman(cell)
        for name, pair in expected.items():
            off = np.array(told["hashin_shtrikman"][name]) - pair
            findings.record("bounds", relative(off, pair[1]), f"bounds.hashin_shtrikman.{name}")


def _hashin_shtrikman(cell: DiscreteCell) -> dict[str, tuple[float, float]]:
    """1 / <1 / (m + m*)> - m* with m* = mu0 for m = k, k0 mu0 / (k0 + 2 mu0) for m = mu (Walpole 1969)."""
    bulk, shear = np.array([_isotropic_part(c) for c in cell.stiffnesses]).T
    found: dict[str, list[float]] = {"bulk": [], "shear": []}
    for choose in (np.min, np.max):
        k0, mu0 = choose(bulk), choose(shear)
        for name, moduli, added in (("bulk", bulk, mu0), ("shear", shear, k0 * mu0 / (k0 + 2 * mu0))):
            found[name].append(float(1 / (cell.fractions @ (1 / (moduli + added))) - added))
    return {name: (pair[0], pair[1]) for name, pair in found.items()}


LISTS = ("angle", "path", "load", "envelope")


def check_tables(findings: Findings, directory: Path, document: Mapping[str, Any]) -> None:
    """angle.csv, path.csv, load.csv and envelope.csv, each with a row a point."""
    for name in LISTS:
        path = directory / f"{name}.csv"
        if name in document and path.is_file():
            points = document[name] if isinstance(document[name], list) else [document[name]]
            _check_table(findings, path, [dict(_columns(point)) for point in points])


def _check_table(findings: Findings, path: Path, points: Sequence[Mapping[str, str]]) -> None:
    stream = io.StringIO(input_files.read(path).decode("utf-8", "replace"), newline="")
    rows = list(csv.DictReader(stream))
    columns = list(dict.fromkeys(name for point in points for name in point))
    told = [*rows[0]] if rows else columns
    findings.record("CSV", 0.0 if len(rows) == len(points) else np.inf, f"{path.name}, the number of its rows")
    findings.record("CSV", 0.0 if sorted(told) == sorted(columns) else np.inf, f"{path.name}, its columns")
    for number, (row, point) in enumerate(zip(rows, points, strict=False)):
        wrong = next((name for name in columns if row.get(name) != point.get(name, "")), None)
        findings.record("CSV", 0.0 if wrong is None else np.inf, f"{path.name}, row {number}, {wrong}")


def _columns(point: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the names of the numbers of a point, and how a table writes them."""
    for name, value in point.items():
        if name in ("strain", "stress", "thermal_stress"):
            components = NAMES[len(value)][name != "strain"]
            prefix = "thermal_" if name == "thermal_stress" else ""
            yield from zip([f"{prefix}{component}" for component in components], map(str, value), strict=True)
        elif name == "stiffness":
            yield from ((f"C{i}{j}", str(C)) for i, row in enumerate(value, 1) for j, C in enumerate(row, 1))
        elif value is None or isinstance(value, int | float | str):
            yield name, "" if value is None else str(value)
