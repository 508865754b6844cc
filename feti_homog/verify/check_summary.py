"""Laws of the numbers that result.json sums up: of the mesh, the constants, the bounds; and of the tables beside it."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import gammaln

from feti_homog.system.runtime import input_files
from feti_homog.typing import Float
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import StateNumbers
from feti_homog.verify.constitutive_law import VOIGT, turned
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import NAMES

Section = Mapping[str, Any]
DIRECTIONS = 720  # across the fibres, in half a turn


def check_summary(findings: Findings, cell: DiscreteCell) -> None:
    """Check the sections `cell`, `moduli` and `bounds` of result.json, if present."""
    document = cell.files.document
    _check_cell(findings, cell, document["cell"])
    _check_fibres(findings, cell, document["fibres"])
    if document.get("moduli") is not None:
        values = moduli(np.array(document["effective_stiffness"]))
        _check_numbers(findings, "moduli", document["moduli"], values, ratios=("eta", "anisotropy"))
    if document.get("bounds") is not None:
        _check_bounds(findings, cell, document["bounds"], np.array(document["effective_stiffness"]))


def _check_cell(findings: Findings, cell: DiscreteCell, given: Section) -> None:
    width, height = cell.files.size
    names, mesh = cell.files.phases, cell.files.mesh
    fibres = [number for number, name in enumerate(names) if name not in ("matrix", "coating")]
    expected = {"width": width, "height": height, "area": width * height, "elements": len(mesh.triangles)}
    expected |= {"porosity": cell.porosity}
    expected |= {"nodes": len(mesh.points), "fibre_fraction": float(cell.fractions[fibres].sum())}
    for name, value in expected.items():
        scale = 1.0 if name in ("fibre_fraction", "porosity") else abs(value) or 1.0
        findings.record("cell", abs(given.get(name, 0.0) - value) / scale, f"cell.{name}")
    for name, value in zip(names, cell.fractions, strict=True):
        findings.record("cell", abs(given["fractions"][name] - value), f"cell.fractions.{name}")


def _check_fibres(findings: Findings, cell: DiscreteCell, given: Sequence[Section]) -> None:
    """Check that the list of fibres is that of result.h5, in the order of their numbers."""
    fibres, phases = cell.files.fibres, cell.files.phases
    numbers = np.arange(1, len(fibres.number) + 1)
    findings.record("tables", np.where(np.array_equal(fibres.number, numbers), 0.0, np.inf), "/fibre/number")
    listed = [(fibre["number"], fibre["phase"]) for fibre in given]
    expected = [(number, phases[phase]) for number, phase in zip(numbers, fibres.phase, strict=True)]
    findings.record("tables", np.where(listed == expected, 0.0, np.inf), "fibres")
    if listed == expected:
        circles = np.array([[*fibre.get("centre", (None, None)), fibre.get("radius")] for fibre in given], float)
        circles = circles.reshape(-1, 3)  # of a cell without fibres too
        stored = np.column_stack([fibres.centre, fibres.radius])
        off = np.where(np.isnan(circles) & np.isnan(stored), 0.0, circles - stored)
        findings.record("tables", relative(off, cell.files.size.max()).max(axis=1), lambda i: f"fibres[{i}]")
        factors = np.array([fibre.get("strength", 1.0) for fibre in given]) - fibres.strength
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
    spherical, full = c[:2, :2].sum(), c[0, 0] + c[1, 1] + 2 * c[2, 2]
    return float(spherical / 4), float((full - spherical / 2) / 4)


def _square(c: Float) -> float:
    """C_ijkl C_ijkl."""
    index = np.array([0, 2, 2, 1])
    return float(np.square(c[index[:, None], index[None]]).sum())


def _check_bounds(findings: Findings, cell: DiscreteCell, given: Section, stiffness: Float) -> None:
    """Voigt's and Reuss' bounds, those of Hashin and Shtrikman, and the order of all."""
    upper, lower = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses), cell.reuss
    size = float(np.abs(upper).max())
    for name, bound in (("voigt", upper), ("reuss", lower)):
        findings.record("bounds", relative(np.array(given[name]) - bound, size), f"bounds.{name}")
    for place, gap in (("Voigt - L", upper - stiffness), ("L - Reuss", stiffness - lower)):
        least = float(np.linalg.eigvalsh((gap + gap.T) / 2).min())
        findings.record("bounds", max(-least, 0.0) / size, f"the least eigenvalue of {place}")
    if given["hashin_shtrikman"] is not None:
        expected = _hashin_shtrikman(cell)
        for name, pair in expected.items():
            off = np.array(given["hashin_shtrikman"][name]) - pair
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
    given = [*rows[0]] if rows else columns
    findings.record("CSV", 0.0 if len(rows) == len(points) else np.inf, f"{path.name}, the number of its rows")
    findings.record("CSV", 0.0 if sorted(given) == sorted(columns) else np.inf, f"{path.name}, its columns")
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


def check_spatial(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Check the quantities that follow from the stiffness, and the thermal stress.

    The thermal stress follows from the states under unit strains.
    """
    document = cell.files.document
    if "effective_stiffness" in document:
        _check_stiffness(findings, document)
    for place, thermal, own in _thermal_stresses(cell, states):
        _check_levin(findings, cell, place, thermal, own)


def _check_stiffness(findings: Findings, document: Section) -> None:
    stiffness = np.array(document["effective_stiffness"])
    thermal = document.get("thermal_stress")
    # Columns that are secants of one load each have no inverse that means anything.
    is_linear = "effective_stiffness_compression" not in document
    findings.record("compliance", 0.0 if is_linear is ("compliance" in document) else np.inf, "compliance")
    if "compliance" in document:
        compliance = np.array(document["compliance"])
        off = np.abs(compliance @ stiffness - np.eye(6)).max(axis=1)
        # Rows of the product are summed of terms that cancel.
        findings.record("compliance", relative(off, (np.abs(compliance) @ np.abs(stiffness)).max(axis=1)), "compliance")
    strains = None
    if "thermal_expansion" in document:
        strains = np.linalg.solve(stiffness, -np.array(thermal, float))
        off = np.array(document["thermal_expansion"]) - strains
        findings.record("compliance", relative(off, float(np.abs(strains).max())), "thermal_expansion")
    for section, values in (
        ("constants", engineering_constants(stiffness)),
        ("transversely_isotropic", about_fibres(stiffness, strains)),
        ("transverse_moduli", _across_fibres(stiffness)),
    ):
        if document.get(section) is not None:
            _check_numbers(findings, section, document[section], values, ratios=("nu", "deviation"))


def _check_numbers(
    findings: Findings, section: str, given: Section, values: Mapping[str, float | None], ratios: tuple[str, ...]
) -> None:
    """Check constants; the scale of those whose names begin as `ratios` is 1 at least."""
    for name, value in values.items():
        place = f"{section}.{name}"
        if value is None or given[name] is None:
            findings.record("moduli", 0.0 if value is given[name] else np.inf, place)
        else:
            scale = max(abs(value), 1.0) if name.startswith(ratios) else abs(value)
            findings.record("moduli", relative(np.array(given[name] - value), scale), place)


def engineering_constants(stiffness: Float) -> dict[str, float]:
    """From the strains under unit stresses: E_i, nu_ij = -eps_j / eps_i under stress along i, G_ij."""
    strain = np.linalg.solve(stiffness, np.eye(6)).T
    found = {f"E{i + 1}": float(1 / strain[i, i]) for i in range(3)}
    found |= {f"nu{i + 1}{j + 1}": float(-strain[i, j] / strain[i, i]) for i, j in ((0, 1), (0, 2), (1, 2))}
    return found | {f"G{name}": float(1 / strain[k, k]) for name, k in (("23", 3), ("13", 4), ("12", 5))}


def about_fibres(stiffness: Float, strains: Float | None) -> dict[str, float | None]:
    """Constants of the mean of the tensor over turns about x3, and how far it is from that."""
    angles = np.arange(5) * 72.0  # exact: the turned tensor has no more than four waves in a turn
    mean = np.mean([turned(stiffness, angle) for angle in angles], axis=0)
    own = engineering_constants(mean)
    voigt = VOIGT[6]
    norms = [
        np.linalg.norm(matrix[voigt[:, :, None, None], voigt[None, None]]) for matrix in (stiffness - mean, stiffness)
    ]
    return {
        "E_axial": own["E3"], "E_transverse": own["E1"], "nu_transverse": own["nu12"],
        "nu_axial": own["nu13"] * own["E3"] / own["E1"], "G_axial": own["G13"], "G_transverse": own["G12"],
        "K_transverse": float(mean[0, 0] + mean[0, 1]) / 2, "deviation": float(norms[0] / norms[1]),
        "expansion_axial": None if strains is None else float(strains[2]),
        "expansion_transverse": None if strains is None else float(strains[:2].mean()),
    }  # fmt: skip


def _across_fibres(stiffness: Float) -> dict[str, float]:
    """Return the ranges of E1 and G12 in axes turned about x3."""
    angles = 180.0 * np.arange(DIRECTIONS) / DIRECTIONS
    constants = [engineering_constants(turned(stiffness, angle)) for angle in angles]
    E, G = (np.array([own[name] for own in constants]) for name in ("E1", "G12"))
    return {
        "E_least": float(E.min()), "E_largest": float(E.max()),
        "G_least": float(G.min()), "G_largest": float(G.max()),
    }  # fmt: skip


def _thermal_stresses(
    cell: DiscreteCell, states: Sequence[StateNumbers]
) -> Iterator[tuple[str, Float, Sequence[StateNumbers]]]:
    """Yield each reported thermal stress, its place, and the states of the same stiffness."""
    document = cell.files.document
    if cell.expansions is None:
        return
    if "effective_stiffness" in document:
        yield "thermal_stress", np.array(document["thermal_stress"]), states
    for number, point in enumerate(document.get("angle", ())):
        own = [state for state in states if state.point == number]
        yield f"angle[{number}].thermal_stress", np.array(point["thermal_stress"]), own


def _check_levin(
    findings: Findings, cell: DiscreteCell, place: str, thermal: Float, states: Sequence[StateNumbers]
) -> None:
    """Check a thermal stress by reciprocity, which does not hold with contact without tension."""
    if cell.files.contact and any((state.status != BONDED).any() for state in states):
        return
    scale = float(np.abs(thermal).max())
    for state in states:
        if not state.temperature:
            off = float(thermal @ state.strain) + state.expanding
            findings.record("Levin", relative(np.array(off), scale), f"{place}, {state.name}")
