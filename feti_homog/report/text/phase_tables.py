"""Tables of the largest stresses of the phases, and of the utilisation of their strengths."""

from collections.abc import Sequence
from typing import Any

from feti_homog.materials import voigt
from feti_homog.report.text.tables import UNKNOWN, Column, Table, stress_label, without_noise
from feti_homog.typing import Document

POINTS = 4  # of a curve
STRESSES = {"principal": "principal", "von_mises": "von Mises", "hydrostatic": "hydrostatic"}


def phase_tables(document: Document) -> list[Table]:
    """Return tables of stresses and utilisations in all states, or at some points on a curve; [] without stresses."""
    phases = document.get("phase_stresses", ())
    if not phases:
        return []
    labels, states = phases[0]["state"], _states(document, len(phases[0]["state"]))
    pairs = [(phase, k) for k in states for phase in phases]
    names = [f"{labels[k]} {phase['phase']}" if len(labels) > 1 else phase["phase"] for phase, k in pairs]
    first = Column("", -max(16, *(len(name) + 2 for name in names)), indent=0)
    heads = [first, *(column for title in STRESSES.values() for column in (Column(title), Column("at", 16)))]
    rows = [
        [name, *(value for measure in STRESSES for value in _entry(phase, measure, k))]
        for name, (phase, k) in zip(names, pairs, strict=True)
    ]
    loads = " or temperature, all others 0" if "temperature" in labels else ", all others 0"
    loads = f", under one unit strain{loads}" if labels[0].split()[-1] in voigt.SPATIAL_STRAINS else ""
    tables = [Table(f"Largest stresses of the phases{stress_label(document)}, tension positive{loads}", heads, rows)]
    has_modes, load = any(phase.get("mode") for phase in phases), document["case"].get("load", {}).get("to", {})
    acting = [name for name, value in load.items() if value]
    # stresses in proportion to the load
    has_factors = "path" not in document and not ("temperature" in acting and len(acting) > 1)
    stresses = [name for name in acting if has_factors and acting == [name] and name.startswith("S")]
    used = list[list[Any]]()
    for name, (phase, k) in zip(names, pairs, strict=True):
        if "criterion" in phase:
            value, place = _entry(phase, "utilisation", k)
            used.append([name, phase["criterion"], value, place])
            used[-1] += [phase["mode"][k] if phase.get("mode") and value else UNKNOWN] * has_modes
            used[-1] += [1.0 / value if value else UNKNOWN] * has_factors
            used[-1] += [load[name] / value if value else UNKNOWN for name in stresses]
    heads = [first, Column("criterion", 20), Column("utilisation"), Column("at", 16)]
    heads += [Column("mode", 20)] * has_modes + [Column("load factor")] * has_factors
    heads += [Column(f"at {name}") for name in stresses]
    alone = "".join(f", at this {name}," for name in stresses)
    notes = [f"  load factor: at this multiple of the load{alone} the utilisation is 1"] * has_factors
    return [*tables, *([Table(f"Utilisation of the strengths{loads}", heads, used, below=notes)] if used else [])]


def _states(document: Document, count: int) -> Sequence[int]:
    """Return the numbers of the states that the tables show."""
    if "path" in document and "states" in document:
        from feti_homog.results import landmarks  # of paths alone

        return landmarks.landmark_states(document, POINTS, count)
    points = len(document.get("angle", ())) or (count if "path" in document else 1)
    step, loads = -(-points // POINTS), count // points
    return [point * loads + load for point in range(0, points, step) for load in range(loads)]


def _entry(phase: Document, name: str, k: int) -> tuple[Any, str]:
    """Return a value and its position in words, "-" for the value zero."""
    value, (x, y) = without_noise(phase[name][k]), phase[f"{name}_at"][k]
    return value, f"{x:.3g}, {y:.3g}" if value else "-"
