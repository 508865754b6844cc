"""Values of the solver's own options, checked without PETSc before any work."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from feti_homog.common.petsc_option_table import OPTIONS

Value = str | int | float | bool


def faulty_values(options: Mapping[str, Value]) -> list[str]:
    """One fault for each option (name without dash) that cannot have its value."""
    faults = []
    for name in RULES.keys() & options.keys():
        (expected, holds), text = RULES[name], str(options[name])
        if not holds(text):
            faults.append(f"{f'-{name} {text}'.strip()}: expected {expected}")
    return sorted(faults)


def _is_share(text: str) -> bool:
    try:
        return 0.0 < float(text) < 1.0
    except ValueError:
        return False


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit() and int(text) > 0


def _names(known: list[str]) -> tuple[str, Callable[[str], bool]]:
    return f"one of {', '.join(known)}", known.__contains__


SHARE = "a number above 0 and below 1", _is_share
# With a relative tolerance of 1 or more nothing is solved.
RULES = {
    "feti_ksp_rtol": SHARE,
    "feti_coarse_threshold": SHARE,
    "feti_ksp_max_it": ("an integer of at least 1", _is_count),
} | {
    option.name: _names(option.value.split("|"))
    for option in OPTIONS
    if option.name in ("feti_pc_type", "feti_dual_operator", "feti_coarse_space")
}
"""For each of these options, what is expected in words, and whether a text is that."""
