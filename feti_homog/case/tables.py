"""The tables of a case file, and where each key belongs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from feti_homog.case.interface_section import Arc
from feti_homog.case.mixed_load import MixedLoad
from feti_homog.case.sections import SECTIONS
from feti_homog.materials.forms import MATERIAL_FORMS
from feti_homog.schema.keys import keys_of

REQUIRED = ("cell", "material", "analysis")
TOP_LEVEL = (*SECTIONS, "material", "petsc", "name")


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        section: the section in which it stands.
        place: its place in the file, in words.
        contents: the dataclass that lists its keys.
        form: which of several forms of the table this is, empty if there is one.
    """

    section: str
    place: str
    contents: type[Any]
    form: str = ""


TABLES = (
    *(Table(section, f"[{section}]", contents) for section, contents in SECTIONS.items()),
    *(Table("material", "[material.PHASE]", contents, form) for form, contents in MATERIAL_FORMS.items()),
    Table("interface", "an arc of [interface] debonded", Arc),
    Table("path", "a load of [path] to or waypoints", MixedLoad),
    Table("load", "[load] to", MixedLoad),
)


def _places(name: str) -> str:
    return " or ".join(table.place for table in TABLES if name in keys_of(table.contents))


KEY_OWNERS = {name: _places(name) for table in TABLES for name in keys_of(table.contents)}
"""By key, the tables to which it belongs, in words."""
