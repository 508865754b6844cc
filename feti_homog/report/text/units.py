"""The units of what a sweep varies and of what comes out."""

from __future__ import annotations

import re

STRESSES = ("young", "E1", "E2", "E3", "E_axial", "E_transverse", "G12", "G13", "G23", "G_axial",
           "G_transverse", "K_transverse", "stiffness", "normal_strength", "tangential_strength",
           "dissipated", "dissipated_strain_controlled", "work", "load_stored")  # fmt: skip
MODULI = re.compile(r"(C\d\d|S\d\d|bulk|shear)(_\w+)?|anisotropy_\w+|\w+_(C|S)\d\d")
FIXED = {"angle": "degrees", "centre": "degrees", "values": "degrees", "memory": "bytes"}


def unit(name: str, stress_unit: str) -> str:
    """Return the unit of a key of a case file, dotted, or of a column of a sweep's table; empty if it has none."""
    last = name.rpartition(".")[2]
    if last.startswith("seconds_"):
        return "s"
    if last in STRESSES or MODULI.fullmatch(last):
        return stress_unit
    return FIXED.get(last, "")


def with_unit(name: str, stress_unit: str) -> str:
    """Return the name and, in brackets, the unit that it has."""
    return name + in_brackets(unit(name, stress_unit))


def in_brackets(unit: str) -> str:
    """Return the unit for a title: in brackets after a space; empty if there is none."""
    return f" ({unit})" if unit else ""
