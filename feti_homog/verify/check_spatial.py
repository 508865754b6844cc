"""Laws of what result.json says of generalized plane strain: compliance, constants, thermal stress and expansion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import StateNumbers
from feti_homog.verify.constitutive_law import VOIGT, turned
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative

DIRECTIONS = 720  # across the fibres, in half a turn
RATIOS = ("nu", "deviation")  # beginnings of the names of numbers whose scale is 1
Section = Mapping[str, Any]


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
            _check_numbers(findings, section, document[section], values)


def _check_numbers(findings: Findings, section: str, told: Section, values: Mapping[str, float | None]) -> None:
    for name, value in values.items():
        place = f"{section}.{name}"
        if value is None or told[name] is None:
            findings.record("moduli", 0.0 if value is told[name] else np.inf, place)
        else:
            scale = max(abs(value), 1.0) if name.startswith(RATIOS) else abs(value)
            findings.record("moduli", relative(np.array(told[name] - value), scale), place)


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
    """By reciprocity, which contact without tension has not."""
    if cell.files.contact and any((state.status != BONDED).any() for state in states):
        return
    scale = float(np.abs(thermal).max())
    for state in states:
        if not state.temperature:
            off = float(thermal @ state.strain) + state.expanding
            findings.record("Levin", relative(np.array(off), scale), f"{place}, {state.name}")
