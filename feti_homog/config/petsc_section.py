"""Reading the section [petsc]: PETSc's options without their dash."""

from __future__ import annotations

import re

from feti_homog.config.values import is_number, text
from feti_homog.config.wording import toml_key, toml_value

Scalar = str | int | float | bool

PREFIXED = r"feti_\w+"
WITHOUT_PREFIX = (
    "log_view", "log_view_memory", "log_trace", "options_left", "options_view", "malloc_debug", "malloc_view",
    "malloc_dump", "memory_view", "on_error_abort", "fp_trap", "info",
)  # fmt: skip
"""PETSc's own options that a case may set."""


OPTION_EXPECTED = "a text, a number, true or false"


def read_petsc(table: object, faults: list[str]) -> dict[str, Scalar]:
    """PETSc's options by name; whether PETSc knows one of prefix feti_ only the run can tell."""
    if not isinstance(table, dict):
        faults.append(f"petsc = {toml_value(table)}: expected a section [petsc]")
        return {}
    wrong = {name: _option_fault(name, value) for name, value in table.items()}
    faults += [
        f"[petsc] {toml_key(name)} = {toml_value(table[name])}: {words}" for name, words in wrong.items() if words
    ]
    return dict(table)


def _option_fault(name: str, value: object) -> str:
    """What is wrong with an option, empty if nothing."""
    if name.startswith("-"):
        return "expected the option's name without its dash"
    if not re.fullmatch(PREFIXED, name) and name not in WITHOUT_PREFIX:
        return f"expected the prefix feti_, or one of {', '.join(WITHOUT_PREFIX)}"
    if not (isinstance(value, bool) or is_number(value) or text.accepts(value)):
        return f"expected {OPTION_EXPECTED}"
    return ""
