"""Check status, reciprocity, bounds, compliance, expansion and engineering constants in result.json."""

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.check_loads import States
from feti_homog.verify.constitutive_law import GRADIENT, VOIGT, turned
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import KKT, Findings, relative, solver_limit
from feti_homog.verify.reading import Status

RTOL = 1e-8  # default tolerance of the dual problems
DIRECTIONS = 720  # number of directions across the fibres in half a turn
SECTIONS = "moduli", "constants", "transversely_isotropic", "transverse_moduli"
NOISE = 1e-3  # bound of noise: absolute for Poisson's ratios, else relative to the largest constant of the kind
# Beginnings of the names of constants that have a scale of at least 1.
RATIOS = ("eta", "anisotropy", "deviation")


def check_status(findings: Findings, cell: DiscreteCell) -> None:
    """Check the tolerances, and that the status follows from checks, convergence reasons of the solver and faults."""
    document, solver = cell.files.document, cell.files.document["solver"]
    # A tolerance from the command line is in no other entry, so that no law can check it.
    is_of_case = solver.hint("rtol") == float(cell.files.case.get("petsc", {}).get("feti_ksp_rtol", RTOL))
    rtol = float(solver["rtol"] if is_of_case else solver.hint("rtol"))
    tolerance, contact_tolerance = document["check_tolerance"], document["kkt_tolerance"]
    findings.record("status", abs(tolerance / solver_limit(rtol) - 1.0), "check_tolerance")
    findings.record("status", abs(contact_tolerance / KKT - 1.0), "kkt_tolerance")
    checks, faults = document["checks"], document.hint("faults", [])
    failed = [name for name in checks if not checks.hint(name) <= (contact_tolerance if "kkt_" in name else tolerance)]
    failed += [reason for reason in solver.hint("converged_reason") if reason < 0]
    failed += [fault for fault in faults if "check " not in fault and "no convergence" not in fault]
    findings.require("status", document["status"] == ("not converged" if failed else "done"), "status")


def check_reciprocity(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check that stiffnesses are symmetric, and that the thermal stress S obeys Levin's formula.

    S : E = -<alpha : L : eps> with strains eps under a strain E, expansions alpha and stiffnesses L of the phases.
    Debonded cells with contact have no reciprocity and are skipped.
    """
    document = cell.files.document
    for number, table in enumerate([document, *document.get("angle", ())], start=-1):
        own_states = [state for state in states if number < 0 or state.point == number]
        if cell.files.contact and any((state.status != Status.BONDED).any() for state in own_states):
            continue
        place = f"angle[{number}]." if number >= 0 else ""
        for name in [name for name in ("effective_stiffness", "effective_conductivity", "stiffness") if name in table]:
            C = np.array(table[name])
            findings.compare("symmetry", C, C.T, np.abs(C).max(), place + name)
        if "thermal_stress" in table:
            thermal = np.array(table["thermal_stress"])
            for state in [state for state in own_states if not state.temperature]:
                error = relative(thermal @ state.strain + state.expanding, np.abs(thermal).max())
                findings.record("Levin", error, f"{place}thermal_stress, {state.name}")


def check_constants(findings: Findings, cell: DiscreteCell) -> None:
    """Check bounds, compliance, thermal expansion and constants against the effective stiffness."""
    document = cell.files.document
    C, heat = np.array(document["effective_stiffness"]), document.get("thermal_stress")
    heat = None if heat is None else np.array(heat)
    if (bounds := document.get("bounds")) is not None:
        upper, lower = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses), cell.reuss
        size = float(np.abs(upper).max())
        findings.compare("bounds", bounds["voigt"], upper, size, "bounds.voigt")
        findings.compare("bounds", bounds["reuss"], lower, size, "bounds.reuss")
        for place, gap in (("Voigt - L", upper - C), ("L - Reuss", C - lower)):
            least = float(np.linalg.eigvalsh((gap + gap.T) / 2).min())
            findings.record("bounds", max(-least, 0.0) / size, f"the least eigenvalue of {place}")
        if bounds["hashin_shtrikman"] is not None:
            # 1 / <1 / (m + m*)> - m* with m* = mu0 for m = k, k0 mu0 / (k0 + 2 mu0) for m = mu (Walpole 1969).
            bulk, shear = np.array([_isotropic_part(c) for c in cell.stiffnesses]).T
            k0, mu0 = (np.array([phases.min(), phases.max()]) for phases in (bulk, shear))
            for name, phases, added in (("bulk", bulk, mu0), ("shear", shear, k0 * mu0 / (k0 + 2 * mu0))):
                pair = 1 / (cell.fractions @ (1 / (phases[:, None] + added))) - added
                findings.compare("bounds", bounds["hashin_shtrikman"][name], pair, pair[1], f"hashin_shtrikman.{name}")
    if cell.files.is_spatial:
        # With contact, the columns are secants under different loads, so that the matrix has no meaningful inverse.
        is_linear = "effective_stiffness_compression" not in document
        findings.require("compliance", is_linear is ("compliance" in document), "compliance")
        if "compliance" in document:
            S = np.array(document["compliance"])
            terms = (np.abs(S) @ np.abs(C)).max(axis=1)[:, None]  # the sums in S C cancel
            findings.compare("compliance", S @ C, np.eye(6), terms, "compliance")
        if "thermal_expansion" in document and heat is not None:
            strains, place = -np.linalg.solve(C, heat), "thermal_expansion"
            findings.compare("compliance", document[place], strains, np.abs(strains).max(), place)
    for section in [name for name in SECTIONS if name in document]:
        constants = {} if document[section] is None else constants_of(C, heat)
        for name in document[section] or ():
            value, expected, place = document[section][name], constants.get(name), f"{section}.{name}"
            if value is None or expected is None:
                findings.require("moduli", value is expected, place)
            else:
                least = NOISE if name.startswith("nu") else float(name.startswith(RATIOS))
                findings.compare("moduli", value, expected, max(abs(expected), least), place)


def check_conductivity(findings: Findings, cell: DiscreteCell) -> None:
    """Check closed-form bounds and estimates; without conductances, Wiener's bounds must enclose the conductivity."""
    k, forms = np.array(cell.files.document["effective_conductivity"]), cell.files.document["conductivity_estimates"]
    share, (x1, _, x3) = cell.fractions, GRADIENT
    axial, across = cell.stiffnesses[:, x3, x3], cell.stiffnesses[:, x1, x1]
    limits = np.array([1 / (share @ (1 / across)), share @ across])
    bounds = [forms["wiener"], forms["hashin_shtrikman"]]
    findings.compare("bounds", forms["axial"], share @ axial, axial.max(), "conductivity_estimates.axial")
    resists = any("conductance" in section for section in cell.files.interfaces)
    findings.require("bounds", bounds == [None, None] if resists else None not in bounds, "conductivity_estimates")
    if not resists:
        findings.compare("bounds", bounds[0], limits, limits[1], "conductivity_estimates.wiener")
        inside = np.linalg.eigvalsh((k + k.T)[:2, :2] / 2)
        off = [limits[0] - inside.min(), inside.max() - limits[1], 0.0]
        findings.record("bounds", max(off) / limits[1], "effective_conductivity")
        pair = [1 / (share @ (1 / (across + k0))) - k0 for k0 in (across.min(), across.max())]
        place = "conductivity_estimates.hashin_shtrikman"
        findings.compare("bounds", bounds[1], pair, limits[1], place)


def constants_of(C: Float, heat: Float | None) -> dict[str, float]:
    """Compute constants by name from the stiffness C (3, 3) or (6, 6) and the thermal stress `heat` (6,) or None.

    Strains eps under a unit stress along x_i give E_i = 1 / eps_i, nu_ij = -eps_j / eps_i, eta_i = gamma_12 / eps_i.
    """
    # Scaled to a unit diagonal, so that rounding in stiff directions does not spoil the others.
    n, voigt, sizes = len(C), VOIGT[len(C)], np.sqrt(np.outer(C.diagonal(), C.diagonal()))
    S = np.linalg.inv(C / sizes) / sizes
    pairs, shears = [(0, 1), (1, 0)], {"G12": 2}
    if n == 6:
        pairs, shears = [(0, 1), (0, 2), (1, 2)], {"G23": 3, "G13": 4, "G12": 5}
    table = {f"C{i + 1}{j + 1}": C[i, j] for i in range(n) for j in range(i, n)}
    table |= {f"E{i + 1}": 1 / S[i, i] for i in range(len(voigt))}
    table |= {f"nu{i + 1}{j + 1}": -S[j, i] / S[i, i] for i, j in pairs}
    table |= {name: 1 / S[k, k] for name, k in shears.items()}
    if n == 3:
        bulk, shear = _isotropic_part(C)
        nearest = np.array([[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]])
        table |= {"eta1": S[2, 0] / S[0, 0], "eta2": S[2, 1] / S[1, 1], "bulk": bulk, "shear": shear}
        table["anisotropy"] = _distance(C, nearest)
    else:
        # The mean over five rotations about x3 is exact: rotated tensor entries have at most four periods per turn.
        mean = np.mean([turned((C + C.T) / 2, angle) for angle in np.arange(5) * 72.0], axis=0)
        sizes = np.sqrt(np.outer(mean.diagonal(), mean.diagonal()))
        M, angle = np.linalg.inv(mean / sizes) / sizes, np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        table |= {
            "E_axial": 1 / M[2, 2], "E_transverse": 1 / M[0, 0], "nu_transverse": -M[0, 1] / M[0, 0],
            "nu_axial": -M[0, 2] / M[2, 2], "G_axial": 1 / M[4, 4], "G_transverse": 1 / M[5, 5],
            "K_transverse": (mean[0, 0] + mean[0, 1]) / 2, "deviation": _distance(C, mean),
        }  # fmt: skip
        # Ranges of E1 and G12 over all turned axes.
        c, s, none = np.cos(angle), np.sin(angle), np.zeros((3, DIRECTIONS))
        tension, slide = np.vstack([c**2, s**2, none, c * s]), np.vstack([-2 * c * s, 2 * c * s, none, c**2 - s**2])
        for name, stress in (("E", tension), ("G", slide)):
            moduli = 1 / np.einsum("ia,ij,ja->a", stress, S, stress)
            table |= {f"{name}_least": moduli.min(), f"{name}_largest": moduli.max()}
    if heat is not None:
        x1, x2, x3 = -np.linalg.solve(C, heat)[:3]
        table |= {"expansion_x1": x1, "expansion_x2": x2, "expansion_axial": x3, "expansion_transverse": (x1 + x2) / 2}
        table |= {f"thermal_S{k + 1}{k + 1}": heat[k] for k in range(3)}
    return {name: float(value) for name, value in table.items()}


def _isotropic_part(c: Float) -> tuple[float, float]:
    """Compute bulk modulus C_iijj / 4 and shear modulus (C_ijij - C_iijj / 2) / 4 nearest to a stiffness `c` (3, 3)."""
    spherical, full = c[:2, :2].sum(), c[0, 0] + c[1, 1] + 2 * c[2, 2]
    return float(spherical / 4), float((full - spherical / 2) / 4)


def _distance(C: Float, other: Float) -> float:
    """Compute the relative distance ||C - C'|| / ||C|| of the tensor C_ijkl from `other`, C'."""
    voigt = VOIGT[len(C)]
    off, size = (np.linalg.norm(M[voigt[:, :, None, None], voigt[None, None]]) for M in (C - other, C))
    return float(off / size)
