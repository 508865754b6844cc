"""The tables of a case file, and where each key belongs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from feti_homog.config.materials import MATERIAL_FORMS
from feti_homog.config.schema import keys_of
from feti_homog.config.sections import SECTIONS, Arc

REQUIRED = ("cell", "material", "analysis")
TOP_LEVEL = (*SECTIONS, "material", "petsc", "name")


@dataclass(frozen=True)
class Table:
    """A table: the section in which it stands, its place there in words, and the dataclass that lists its keys."""

    section: str
    place: str
    contents: type[Any]


TABLES = (
    *(Table(section, f"[{section}]", contents) for section, contents in SECTIONS.items()),
    *(Table("material", "[material.PHASE]", contents) for contents in MATERIAL_FORMS.values()),
    Table("interface", "an arc of [interface] debonded", Arc),
)


def _places(name: str) -> str:
    return " or ".join(table.place for table in TABLES if name in keys_of(table.contents))


KEY_OWNERS = {name: _places(name) for table in TABLES for name in keys_of(table.contents)}
"""By key, the tables to which it belongs, in words."""
