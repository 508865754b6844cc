"""The state under a single load as a short table for the printed summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feti_homog.mechanics.voigt import voigt_names
from feti_homog.output.text.point_tables import STATES

GIVEN = "*"  # behind what the load gives

Document = Mapping[str, Any]


def load_table(document: Document, stress: str) -> list[str]:
    """A row for each component, what the load gives marked; temperature, energies and what is debonded."""
    state, given = document["load"], document["case"]["load"]["to"]
    names = list(zip(*voigt_names(len(state["strain"])), strict=True))
    scales = [max(map(abs, state[name])) for name in ("strain", "stress")]
    lines = [f"State under the load{stress}; {GIVEN} what it gives", f"{'':>6}{'strain':>16}{'stress':>18}"]
    for pair, *values in zip(names, state["strain"], state["stress"], strict=True):
        strain, sigma = (
            f"{_rounded(value, scale):>16.7g}" + (GIVEN if name in given else " ")
            for name, value, scale in zip(pair, values, scales, strict=True)
        )
        lines.append(f"{pair[1][1:]:>6}{strain} {sigma}".rstrip())
    springs = f", {state['stored_in_springs']:.6g} of it in springs" if state["stored_in_springs"] else ""
    counts = ", ".join(f"{state[name]} {name}" for name in STATES)
    return [
        *lines,
        *([f"Temperature: {state['temperature']:g}"] if "temperature" in state else []),
        f"Stored per area{stress}: {state['stored']:.6g}{springs}",
        f"Debonded: {100 * state['debonded_share']:.1f} % of the interfaces; {counts} nodes",
    ]


def _rounded(value: float, scale: float) -> float:
    """Zero in place of what the solver leaves of it."""
    return value if abs(value) > 1e-12 * scale else 0.0
