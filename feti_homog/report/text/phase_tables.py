"""Tables of the largest stresses of the phases, and of the utilisation of their strengths."""

from collections.abc import Sequence
from typing import Any

from feti_homog.report.text.tables import Column, Table, stress_label, without_noise
from feti_homog.typing import Document

STATES = 4  # of a curve
STRESSES = {"principal": "principal", "von_mises": "von Mises", "hydrostatic": "hydrostatic"}


def phase_tables(document: Document) -> list[Table]:
    """Return tables of phase stresses and utilisations, for all loads or selected states of a curve."""
    phases = document.get("phase_stresses", ())
    count = max((len(phase["state"]) for phase in phases), default=0)
    states: Sequence[int] = range(count)
    if "path" in document and "states" in document:
        from feti_homog.results import landmarks  # of paths alone

        states = landmarks.chosen_states(document, STATES, count)
    elif "path" in document or "angle" in document:
        states = states[:: -(-count // STATES) or 1]
    rows = [
        [_label(phase, k), *(value for name in STRESSES for value in _entry(phase, name, k))]
        for k in states
        for phase in phases
    ]
    columns = [Column("", -18, indent=0)]
    for title in STRESSES.values():
        columns += [Column(title, 12), Column("at", 15)]
    used = [
        [_label(phase, k), phase["criterion"], *_entry(phase, "utilisation", k)]
        for k in states
        for phase in phases
        if "criterion" in phase
    ]
    title = f"Largest stresses of the phases{stress_label(document)}, tension positive"
    strength_columns = [Column("", -18, indent=0), Column("criterion", 20), Column("utilisation", 12), Column("at", 15)]
    tables = [Table(title, columns, rows), Table("Utilisation of the strengths", strength_columns, used)]
    return [table for table in tables if table.rows]


def _label(phase: Document, k: int) -> str:
    """Return the names of state and phase; the phase alone if there is a single state."""
    return f"{phase['state'][k]} {phase['phase']}" if len(phase["state"]) > 1 else str(phase["phase"])


def _entry(phase: Document, name: str, k: int) -> tuple[Any, str]:
    """Return the largest value of a phase quantity in state `k`, with the position as text."""
    x, y = phase[f"{name}_at"][k]
    return without_noise(phase[name][k]), f"{x:.4g}, {y:.4g}"
