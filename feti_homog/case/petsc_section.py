"""Reading the section [petsc]: PETSc's options of the solver without their dash.

What PETSc itself takes, as -log_view, it reads when it starts and ends, which is on the command line alone.
"""

from __future__ import annotations

import re

from feti_homog.schema.values import is_number, text
from feti_homog.schema.wording import toml_key, toml_value

Scalar = str | int | float | bool

PREFIXED = r"feti_\w+"
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
    """Return the fault of an option, empty if there is none."""
    if name.startswith("-"):
        return "expected the option's name without its dash"
    if not re.fullmatch(PREFIXED, name):
        return "expected the prefix feti_; PETSc's own options are for the command line"
    if not (isinstance(value, bool) or is_number(value) or text.accepts(value)):
        return f"expected {OPTION_EXPECTED}"
    return ""
