"""Laws of the numbers that result.json sums up: of the mesh, the constants, the bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import gammaln

from feti_homog.typing import Float
from feti_homog.verify.bonds import COATING
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import States
from feti_homog.verify.check_mesh import from_centre
from feti_homog.verify.constitutive_law import VOIGT, turned
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.leaves import Section

DIRECTIONS = 720  # across the fibres, in half a turn


def check_summary(findings: Findings, cell: DiscreteCell) -> None:
    """Check the sections `cell`, `moduli` and `bounds` of result.json, if present."""
    document, given, mesh = cell.files.document, cell.files.document["cell"], cell.files.mesh
    (width, height), names = cell.files.size, cell.files.phases
    fibres = [number for number, name in enumerate(names) if name not in ("matrix", COATING)]
    expected = {"width": width, "height": height, "area": width * height, "elements": len(mesh.triangles)}
    expected |= {"nodes": len(mesh.points)}
    shares = {"fibre_fraction": float(cell.fractions[fibres].sum()), "porosity": cell.porosity}
    for name, value in (expected | shares).items():
        scale = 1.0 if name in shares else abs(value) or 1.0
        findings.record("cell", abs(given.get(name, 0.0) - value) / scale, f"cell.{name}")
    for name, value in zip(names, cell.fractions, strict=True):
        findings.record("cell", abs(given["fractions"][name] - value), f"cell.fractions.{name}")
    _check_fibres(findings, cell, document["fibres"])
    if document.get("moduli") is not None:
        values = moduli(np.array(document["effective_stiffness"]))
        _check_numbers(findings, "moduli", document["moduli"], values, ratios=("eta", "anisotropy"))
    if document.get("bounds") is not None:
        _check_bounds(findings, cell, document["bounds"], np.array(document["effective_stiffness"]))


def _check_fibres(findings: Findings, cell: DiscreteCell, given: Sequence[Section]) -> None:
    """Check the scatter of strengths, and semi-axes and coatings of result.json against the mesh."""
    fibres, rows, size = cell.files.fibres, cell.files.interface, cell.files.size
    findings.record("tables", _unlike_scatter(cell), "/fibre/strength at fibre {}".format)
    thickness = _coatings(cell)
    for number, fibre in enumerate(given):
        if (axes := fibre.get("semi_axes")) is not None:
            c, s = np.cos(turn := np.radians(fibre["angle"])), np.sin(turn)
            own = (rows.fibre == number + 1) & (rows.body == fibres.body[number])
            away = from_centre(rows.points[own], fibres.centre[number], size) @ np.array([[c, -s], [s, c]]) / axes
            findings.record("interface", np.abs(np.hypot(*away.T) - 1.0), f"fibres[{number}].semi_axes")
        if number in thickness:
            off = thickness[number] / fibre.get("coating", np.nan) - 1.0
            findings.record("interface", np.abs(off), f"fibres[{number}].coating")


def _coatings(cell: DiscreteCell) -> dict[int, float]:
    """Thickness of the coatings of round fibres, by fibre: of each body of them the farthest node from the nearest."""
    mesh, fibres, found = cell.files.mesh, cell.files.fibres, dict[int, float]()
    if COATING not in cell.files.phases or np.isnan(fibres.radius).any():
        return found
    phase = cell.files.phases.index(COATING)
    for body in np.unique(mesh.body[mesh.phase == phase]):
        points = mesh.points[np.unique(mesh.triangles[(mesh.phase == phase) & (mesh.body == body)])]
        circles = zip(fibres.centre, fibres.radius, strict=True)
        heights = np.stack([np.hypot(*from_centre(points, c, cell.files.size).T) - R for c, R in circles])
        nearest = int(heights.min(axis=1).argmin())
        found[nearest] = float(heights[nearest].max())
    return found


def _unlike_scatter(cell: DiscreteCell) -> Float:
    """(f,) errors of the strengths of fibres, quantiles of Weibull's distribution with mean 1, unless of a table."""
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
        # 1 / <1 / (m + m*)> - m* with m* = mu0 for m = k, k0 mu0 / (k0 + 2 mu0) for m = mu (Walpole 1969).
        bulk, shear = np.array([_isotropic_part(c) for c in cell.stiffnesses]).T
        k0, mu0 = (np.array([own.min(), own.max()]) for own in (bulk, shear))
        for name, own, added in (("bulk", bulk, mu0), ("shear", shear, k0 * mu0 / (k0 + 2 * mu0))):
            pair = 1 / (cell.fractions @ (1 / (own[:, None] + added))) - added
            off = np.array(given["hashin_shtrikman"][name]) - pair
            findings.record("bounds", relative(off, pair[1]), f"bounds.hashin_shtrikman.{name}")


def check_spatial(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the quantities that follow from the stiffness, and thermal stresses by the states under unit strains."""
    document = cell.files.document
    if "effective_stiffness" in document:
        _check_stiffness(findings, document)
    if "effective_stiffness" in document and cell.expansions is not None:
        _check_levin(findings, cell, "thermal_stress", document["thermal_stress"], states)
    for number, point in enumerate(document.get("angle", ()) if cell.expansions is not None else ()):
        own = [state for state in states if state.point == number]
        _check_levin(findings, cell, f"angle[{number}].thermal_stress", point["thermal_stress"], own)


def _check_stiffness(findings: Findings, document: Section) -> None:
    stiffness = np.array(document["effective_stiffness"])
    thermal = document.get("thermal_stress")
    # Columns that are secants of one load each have no inverse that means anything.
    is_linear = "effective_stiffness_compression" not in document
    findings.require("compliance", is_linear is ("compliance" in document), "compliance")
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
            findings.require("moduli", value is given[name], place)
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
    """Return the ranges of E1 and G12 in axes turned about x3, from the energies of stresses of size one."""
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    c, s, none = np.cos(angle), np.sin(angle), np.zeros((3, DIRECTIONS))
    tension, shear = np.vstack([c**2, s**2, none, c * s]), np.vstack([-2 * c * s, 2 * c * s, none, c**2 - s**2])
    E, G = (1 / np.einsum("ia,ij,ja->a", own, np.linalg.inv(stiffness), own) for own in (tension, shear))
    return {
        "E_least": float(E.min()), "E_largest": float(E.max()),
        "G_least": float(G.min()), "G_largest": float(G.max()),
    }  # fmt: skip


def _check_levin(findings: Findings, cell: DiscreteCell, place: str, thermal: Sequence[float], states: States) -> None:
    """Check a thermal stress by reciprocity, which does not hold with contact without tension."""
    if cell.files.contact and any((state.status != BONDED).any() for state in states):
        return
    for state in states:
        if not state.temperature:
            off = float(np.dot(thermal, state.strain)) + state.expanding
            findings.record("Levin", relative(np.array(off), np.abs(thermal).max()), f"{place}, {state.name}")
