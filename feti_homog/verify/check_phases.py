"""Laws of the largest stresses in the phases and of phase strengths, by invariants of the stress tensor."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.constitutive_law import PLANE, VOIGT, out_of_plane, phase_constants
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import quadrature_points
from feti_homog.verify.findings import Findings
from feti_homog.verify.reading import State
from feti_homog.verify.torus import from_centre

LAW = "phases"
# Names of criteria by a key that no other criterion has.
CRITERIA = dict(principal="maximum principal", von_mises="von Mises", tension="Drucker-Prager", axial_shear="Hashin")
MODES = ("fibre tension", "fibre compression", "matrix tension", "matrix compression")
# Relative differences that count as rounding: of the value at the position of the largest value, from it; and of the
# position from a quadrature point.
SAME_VALUE, SAME_PLACE = 1e-5, 1e-9
# Least scale of stresses in a phase, relative to L |E|: smaller stresses, as in a free body, are rounding.
ROUNDED = 1e-4


def check_phases(findings: Findings, cell: DiscreteCell, state: State, number: int) -> None:
    """Check the largest stresses of the phases in state `number`, their positions and utilisations."""
    table = cell.files.document.get("phase_stresses", [])
    limits = {name: phase_constants(cell.files.case, name).get("strength") for name in cell.files.phases}
    findings.require(LAW, bool(table) or not any(limits.values()), "phase_stresses, which strengths need")
    if not table:
        return
    stress, points = _stresses(cell, state)
    phase_of = np.repeat(cell.files.mesh.phase, len(stress) // len(cell.files.mesh.phase))
    names = [name for k, name in enumerate(cell.files.phases) if not np.isnan(stress[phase_of == k]).any()]
    findings.require(LAW, sorted(entry["phase"] for entry in table) == sorted(names), "names of the phases")
    for entry in (entry for entry in table if entry["phase"] in names):
        name, labels = entry["phase"], [str(label) for label in entry["state"]]
        phase, strength = cell.files.phases.index(name), limits[name]
        is_labelled = number < len(labels) and state.name.endswith(f"({labels[number]})")
        findings.require(LAW, is_labelled and len(labels) == len(cell.files.file["state"]), f"{state.name}: its label")
        rows = phase_of == phase
        values, scale = _measures(stress[rows], strength), float(np.abs(stress[rows]).max())
        rounded = ROUNDED * float(np.abs(cell.stiffnesses[phase]).max()) * cell.scales_of(state).strain
        raised = max(1.0, rounded / scale) if scale > 0.0 else 1.0
        for measure, column in values.items():
            place = f"{state.name}, {measure} of {name}"
            reported, at = entry.get(measure), entry.get(f"{measure}_at")
            if not len(reported or ()) == len(at or ()) == len(labels):
                findings.require(LAW, False, f"{place}: missing")
                continue
            size = raised * float(np.abs(column).max()) if measure == "utilisation" else max(scale, rounded)
            findings.compare(LAW, float(reported[number]), column.max(), size, place)
            distance = np.hypot(*from_centre(points[rows], np.array(at[number]), cell.files.shift).T)
            near = column[distance < SAME_PLACE * cell.files.size.max()]
            is_largest = bool((near >= column.max() - SAME_VALUE * size).any())
            findings.require(LAW, is_largest, f"{place}: another position")
        key = next((key for key in CRITERIA if key in (strength or ())), "")
        findings.require(LAW, entry.get("criterion") == CRITERIA.get(key), f"{name}: its criterion")
        if strength is not None and key == "axial_shear":
            modes, mode = _hashin(stress[rows], strength), dict(enumerate(entry.get("mode") or ())).get(number)
            used = modes[MODES.index(mode)].max() if mode in MODES else -np.inf
            findings.require(LAW, used >= (1 - SAME_VALUE * raised) * np.max(modes), f"{state.name}, mode of {name}")


def _stresses(cell: DiscreteCell, state: State) -> tuple[Float, Float]:
    """Compute stress tensors (n, 3, 3) at all quadrature points, and the points (n, 2)."""
    mesh, v = cell.files.mesh, len(state.strain)
    free = state.temperature * cell.expansions
    answers = [answer for *_, answer in cell.elements.responses(state.displacement, state.along, free)]
    stress = np.concatenate(answers)
    tensors = np.zeros((*stress.shape[:2], 3, 3))
    size = len(VOIGT[v])
    tensors[..., :size, :size] = stress[..., VOIGT[v]]
    # S33 follows from the stresses in the plane, also in elements with an internal pressure.
    if v == 3:
        rules, along = out_of_plane(cell.files.case, cell.files.phases)[:, 0], np.zeros(len(free))
    else:
        L, out = cell.stiffnesses, cell.stiffnesses[:, 2, PLANE]
        rules = np.asarray(np.linalg.solve(L[:, PLANE][:, :, PLANE], out[..., None])[..., 0], float)
        along = (L[:, 2, 2] - (rules * out).sum(axis=1)) * (state.along - free[:, 2])
    in_plane = stress[..., PLANE if v == 6 else slice(None)]
    tensors[..., 2, 2] = np.einsum("ei,eqi->eq", rules[mesh.phase], in_plane) + along[mesh.phase, None]
    r = quadrature_points() if mesh.triangles.shape[1] == 6 else np.full((1, 3), 1 / 3)
    functions = r if len(r) == 1 else np.hstack([r * (2 * r - 1), 4 * r * np.roll(r, -1, axis=1)])
    points = np.einsum("qa,ead->eqd", functions, mesh.points[mesh.triangles])
    return tensors.reshape(-1, 3, 3), points.reshape(-1, 2)


def _measures(stress: Float, strength: Mapping[str, Any] | None) -> dict[str, Float]:
    """Compute principal, von Mises and hydrostatic stresses (n,), and the utilisation (n,) of a strength.

    s1 = p + 2/3 q cos(arccos(27 J3 / (2 q^3)) / 3) with q = sqrt(3/2 s : s) and J3 = det s of the deviator s.
    """
    p = np.trace(stress, axis1=1, axis2=2) / 3
    deviator = stress - p[:, None, None] * np.eye(3)
    q = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    third = np.divide(13.5 * np.linalg.det(deviator), q**3, out=np.zeros_like(q), where=q**3 > 0)
    first = p + 2 / 3 * q * np.cos(np.arccos(np.clip(third, -1.0, 1.0)) / 3)
    values = {"principal": first, "von_mises": q, "hydrostatic": p}
    if strength is None:
        return values
    limit = {name: float(value) for name, value in strength.items()}
    if "principal" in limit:
        used = first / limit["principal"]
    elif "von_mises" in limit:
        used = q / limit["von_mises"]
    elif "tension" in limit:  # the cone through both uniaxial strengths: a I1 + sqrt(J2) = k
        T, C = limit["tension"], limit["compression"]
        used = ((C - T) * 3 * p + (C + T) * q) / (2 * C * T)
    else:
        used = np.max(_hashin(stress, limit), axis=0)
    return values | {"utilisation": np.maximum(used, 0.0)}


def _hashin(stress: Float, limit: Mapping[str, float]) -> list[Float]:
    """Compute the utilisation 1 / f (n,) of all `MODES`, a f^2 + b f = 1; both matrix modes near 0."""
    zero = SAME_PLACE * float(np.abs(stress).max(initial=0.0))
    shear = (stress[:, 0, 2] ** 2 + stress[:, 1, 2] ** 2) / limit["axial_shear"] ** 2
    along, across = stress[:, 2, 2], stress[:, 0, 0] + stress[:, 1, 1]
    turned = shear - np.linalg.det(stress[:, :2, :2]) / limit["transverse_shear"] ** 2
    modes = [
        np.where(along > 0, np.sqrt((along / limit["axial_tension"]) ** 2 + shear), 0.0),
        np.where(along < 0, -along / limit["axial_compression"], 0.0),
        np.where(across > -zero, np.sqrt(np.maximum((across / limit["transverse_tension"]) ** 2 + turned, 0.0)), 0.0),
    ]
    ratio = limit["transverse_compression"] / (2 * limit["transverse_shear"])
    b = (ratio**2 - 1) / limit["transverse_compression"] * across
    a = np.maximum((across / (2 * limit["transverse_shear"])) ** 2 + turned, 0.0)
    root = np.sqrt(b**2 + 4 * a)
    return [*modes, np.where(across < zero, (b + root) / 2, 0.0)]
