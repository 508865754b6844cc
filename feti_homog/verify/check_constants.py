"""Laws of the summary in result.json: status, mesh counts, moduli, engineering constants, expansion, bounds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import gammaln

from feti_homog.typing import Float
from feti_homog.verify.check_loads import States
from feti_homog.verify.constitutive_law import VOIGT, turned
from feti_homog.verify.discrete_cell import BONDED, DiscreteCell
from feti_homog.verify.findings import KKT, Findings, Section, relative, solver_limit
from feti_homog.verify.reading import COATING

RTOL = 1e-8  # of the dual problems, by default
DIRECTIONS = 720  # across the fibres, in half a turn
# The scale of constants whose names begin so is 1 at least.
RATIOS = ("eta", "anisotropy", "nu", "deviation")


def check_constants(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the numbers of result.json that sum up a run."""
    document = cell.files.document
    _check_status(findings, cell)
    _check_cell(findings, cell, document["cell"])
    sections: dict[str, Mapping[str, float | None]] = {}
    if "effective_stiffness" in document:
        C = np.array(document["effective_stiffness"])
        if document.get("bounds") is not None:
            _check_bounds(findings, cell, document["bounds"], C)
        if cell.files.is_spatial:
            strains = _check_inverse(findings, document, C)
            sections = {"constants": engineering_constants(C), "transversely_isotropic": about_fibres(C, strains)}
            sections["transverse_moduli"] = _across_fibres(C)
        else:
            sections = {"moduli": moduli(C)}
    for section, values in sections.items():
        if document.get(section) is not None:
            _check_numbers(findings, document[section], values, section)
    for number, table in enumerate([document, *document.get("angle", ())], start=-1):
        if "thermal_stress" in table and cell.expansions is not None:
            of_table = [state for state in states if number < 0 or state.point == number]
            _check_levin(findings, cell, table, of_table, f"angle[{number}].thermal_stress".removeprefix("angle[-1]."))


def _check_numbers(findings: Findings, table: Section, values: Mapping[str, float | None], section: str) -> None:
    for name, value in values.items():
        if value is None or table[name] is None:
            findings.require("moduli", value is table[name], f"{section}.{name}")
        else:
            scale = max(abs(value), float(name.startswith(RATIOS)))
            findings.compare("moduli", table[name], value, scale, f"{section}.{name}")


def _check_status(findings: Findings, cell: DiscreteCell) -> None:
    """Tolerances follow from rtol, the status from checks, convergence and other faults."""
    document, solver = cell.files.document, cell.files.document["solver"]
    # Options of the command line are in no file.
    is_of_case = solver.hint("rtol") == float(cell.files.case.get("petsc", {}).get("feti_ksp_rtol", RTOL))
    rtol = float(solver["rtol"] if is_of_case else solver.hint("rtol"))
    tolerance, of_contact = document["check_tolerance"], document["kkt_tolerance"]
    findings.record("status", abs(tolerance / solver_limit(rtol) - 1.0), "check_tolerance")
    findings.record("status", abs(of_contact / KKT - 1.0), "kkt_tolerance")
    checks, faults = document["checks"], document.hint("faults", [])
    failed = [name for name in checks if not checks.hint(name) <= (of_contact if "kkt_" in name else tolerance)]
    failed += [reason for reason in solver.hint("converged_reason") if reason < 0]
    failed += [fault for fault in faults if "check " not in fault and "no convergence" not in fault]
    findings.require("status", document["status"] == ("not converged" if failed else "done"), "status")


def _check_cell(findings: Findings, cell: DiscreteCell, section: Section) -> None:
    """Check sizes, counts and area fractions against the mesh, and the scatter of strengths against the case."""
    mesh, (width, height), phases = cell.files.mesh, cell.files.size, cell.files.phases
    fibres = [number for number, name in enumerate(phases) if name not in ("matrix", COATING)]
    counts = {"width": width, "height": height, "area": width * height}
    counts |= {"elements": len(mesh.triangles), "nodes": len(mesh.points)}
    for name, value in counts.items():
        findings.compare("cell", section[name], value, value, f"cell.{name}")
    shares = {"fibre_fraction": cell.fractions[fibres].sum(), "porosity": cell.porosity}
    for name, value in shares.items():
        findings.compare("cell", section.get(name, 0.0), value, 1.0, f"cell.{name}")
    for name, value in zip(phases, cell.fractions, strict=True):
        findings.compare("cell", section["fractions"][name], value, 1.0, f"cell.fractions.{name}")
    bonds, rows = cell.files.document["solver"]["interface_nodes"], len(cell.files.interface.points)
    findings.compare("cell", bonds, rows, 1.0, "solver.interface_nodes")
    order = 1 + mesh.triangles.shape[1] // 6
    findings.compare("cell", cell.files.case["cell"].get("order", order), order, 1.0, "case.cell.order")
    # Strengths scatter by Weibull's distribution with mean 1; a table may have others.
    strength, scatter = cell.files.fibres.strength, next(iter(cell.files.interfaces), {}).get("scatter")
    if cell.files.case["cell"]["geometry"] != "table":
        expected = np.ones_like(strength)
        if scatter is not None:
            stream = np.random.default_rng(np.random.SeedSequence(scatter["seed"], spawn_key=(1,)))
            m = scatter["shape"]
            expected = np.exp(np.log(-np.log(1.0 - stream.random(len(strength)))) / m - gammaln(1.0 + 1.0 / m))
        findings.compare("tables", strength, expected, expected, "/fibre/strength at fibre {}".format)


def _check_inverse(findings: Findings, document: Section, C: Float) -> Float | None:
    """Check compliance and thermal expansion; returns the expansion (6,), None if there is none."""
    # Columns that are secants of one load each have no meaningful inverse.
    is_linear = "effective_stiffness_compression" not in document
    findings.require("compliance", is_linear is ("compliance" in document), "compliance")
    if "compliance" in document:
        S = np.array(document["compliance"])
        terms = (np.abs(S) @ np.abs(C)).max(axis=1)[:, None]  # of cancelling sums
        findings.compare("compliance", S @ C, np.eye(6), terms, "compliance")
    if "thermal_expansion" not in document:
        return None
    strains: Float = np.linalg.solve(C, -np.array(document["thermal_stress"], float))
    scale = np.abs(strains).max()
    findings.compare("compliance", document["thermal_expansion"], strains, scale, "thermal_expansion")
    return strains


def _check_levin(findings: Findings, cell: DiscreteCell, table: Section, states: States, place: str) -> None:
    """Check a thermal stress by reciprocity, which contact without tension breaks."""
    if cell.files.contact and any((state.status != BONDED).any() for state in states):
        return
    thermal = np.array(table["thermal_stress"])
    for state in states:
        if not state.temperature:
            error = thermal @ state.strain + state.expanding
            findings.record("Levin", relative(error, np.abs(thermal).max()), f"{place}, {state.name}")


def _check_bounds(findings: Findings, cell: DiscreteCell, bounds: Section, stiffness: Float) -> None:
    """Check Voigt's and Reuss' bounds, Hashin and Shtrikman's, and their order."""
    upper, lower = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses), cell.reuss
    size = float(np.abs(upper).max())
    for name, bound in (("voigt", upper), ("reuss", lower)):
        findings.compare("bounds", bounds[name], bound, size, f"bounds.{name}")
    for place, gap in (("Voigt - L", upper - stiffness), ("L - Reuss", stiffness - lower)):
        least = float(np.linalg.eigvalsh((gap + gap.T) / 2).min())
        findings.record("bounds", max(-least, 0.0) / size, f"the least eigenvalue of {place}")
    if bounds["hashin_shtrikman"] is not None:
        # 1 / <1 / (m + m*)> - m* with m* = mu0 for m = k, k0 mu0 / (k0 + 2 mu0) for m = mu (Walpole 1969).
        bulk, shear = np.array([_isotropic_part(c) for c in cell.stiffnesses]).T
        k0, mu0 = (np.array([phases.min(), phases.max()]) for phases in (bulk, shear))
        for name, phases, added in (("bulk", bulk, mu0), ("shear", shear, k0 * mu0 / (k0 + 2 * mu0))):
            pair = 1 / (cell.fractions @ (1 / (phases[:, None] + added))) - added
            findings.compare("bounds", bounds["hashin_shtrikman"][name], pair, pair[1], f"hashin_shtrikman.{name}")


def moduli(stiffness: Float) -> dict[str, float | None]:
    """Engineering moduli of a stiffness (3, 3), from the strains under unit stresses."""
    by_s11, by_s22, by_s12 = np.linalg.solve(stiffness, np.eye(3)).T
    bulk, shear = _isotropic_part(stiffness)
    nearest = np.array([[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]])
    anisotropy, size = (np.linalg.norm(_tensor(C)) for C in (stiffness - nearest, stiffness))
    return {
        "E1": 1 / by_s11[0], "E2": 1 / by_s22[1], "G12": 1 / by_s12[2],
        "nu12": -by_s11[1] / by_s11[0], "nu21": -by_s22[0] / by_s22[1],
        "eta1": by_s11[2] / by_s11[0], "eta2": by_s22[2] / by_s22[1],
        "bulk": bulk, "shear": shear, "anisotropy": float(anisotropy / size),
    }  # fmt: skip


def _isotropic_part(c: Float) -> tuple[float, float]:
    """Moduli k, mu of the nearest isotropic stiffness: its invariants C_iijj / 4 and (C_ijij - C_iijj / 2) / 4."""
    spherical, full = c[:2, :2].sum(), c[0, 0] + c[1, 1] + 2 * c[2, 2]
    return float(spherical / 4), float((full - spherical / 2) / 4)


def _tensor(C: Float) -> Float:
    """C_ijkl of a stiffness (3, 3) or (6, 6)."""
    voigt = VOIGT[len(C)]
    return np.asarray(C[voigt[:, :, None, None], voigt[None, None]])


def engineering_constants(stiffness: Float) -> dict[str, float | None]:
    """From the strains under unit stresses: E_i, nu_ij = -eps_j / eps_i under stress along i, G_ij."""
    strain = np.linalg.solve(stiffness, np.eye(6)).T
    constants: dict[str, float | None] = {f"E{i + 1}": float(1 / strain[i, i]) for i in range(3)}
    constants |= {f"nu{i + 1}{j + 1}": float(-strain[i, j] / strain[i, i]) for i, j in ((0, 1), (0, 2), (1, 2))}
    return constants | {f"G{name}": float(1 / strain[k, k]) for name, k in (("23", 3), ("13", 4), ("12", 5))}


def about_fibres(stiffness: Float, strains: Float | None) -> dict[str, float | None]:
    """Constants of the tensor's mean over turns about x3, and its distance from this mean."""
    angles = np.arange(5) * 72.0  # exact: the turned tensor has no more than four waves in a turn
    mean = np.mean([turned(stiffness, angle) for angle in angles], axis=0)
    S = np.linalg.inv(mean)
    deviation, size = (np.linalg.norm(_tensor(C)) for C in (stiffness - mean, stiffness))
    return {
        "E_axial": float(1 / S[2, 2]), "E_transverse": float(1 / S[0, 0]), "nu_transverse": float(-S[0, 1] / S[0, 0]),
        "nu_axial": float(-S[0, 2] / S[2, 2]), "G_axial": float(1 / S[4, 4]), "G_transverse": float(1 / S[5, 5]),
        "K_transverse": float(mean[0, 0] + mean[0, 1]) / 2, "deviation": float(deviation / size),
        "expansion_axial": None if strains is None else float(strains[2]),
        "expansion_transverse": None if strains is None else float(strains[:2].mean()),
    }  # fmt: skip


def _across_fibres(stiffness: Float) -> dict[str, float | None]:
    """Return the ranges of E1 and G12 in axes turned about x3, from the energies of unit stresses."""
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    c, s, none = np.cos(angle), np.sin(angle), np.zeros((3, DIRECTIONS))
    tension, shear = np.vstack([c**2, s**2, none, c * s]), np.vstack([-2 * c * s, 2 * c * s, none, c**2 - s**2])
    E, G = (1 / np.einsum("ia,ij,ja->a", stress, np.linalg.inv(stiffness), stress) for stress in (tension, shear))
    return {f"{name}_{end}": float(value) for name, modulus in (("E", E), ("G", G))
            for end, value in (("least", modulus.min()), ("largest", modulus.max()))}  # fmt: skip
