"""Types of values that stand in the sections of a case file: fibres, arcs, strengths, strains, stiffnesses."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

from feti_homog.case.phase_names import FIBRE_PHASE
from feti_homog.schema.values import (
    SMALLEST,
    ValueType,
    integer,
    is_number,
    is_number_list,
    list_of,
    numbers,
    real,
    text,
    to_floats,
)

STRAIN_COMPONENTS = "[E11, E22, gamma12]"
PAIR_EXAMPLE = '["coating", "matrix"]'
FIBRE = integer(least=1)
SEED = integer(least=0, most=10**15)

MESH_SUFFIXES = (".msh", ".inp", ".vtu", ".vtk")
MESH_FILE = ".msh, .inp, .vtu or .vtk file"


def _is_cell_file(value: Any) -> bool:
    return text.accepts(value) and value.endswith((*MESH_SUFFIXES, ".csv"))


def _are_fibres(value: Any) -> bool:
    return isinstance(value, list) and value != [] and all(isinstance(fibre, dict) for fibre in value)


def _is_table_file(value: Any) -> bool:
    return text.accepts(value) and value.endswith(".csv")


def _by_phase(words: str, example: str, number: ValueType) -> ValueType:
    """A table of numbers by the phases of fibres."""

    def accepts(value: Any) -> bool:
        is_table = isinstance(value, dict) and value != {}
        return is_table and all(map(FIBRE_PHASE.fullmatch, value)) and all(map(number.accepts, value.values()))

    return ValueType(
        f"a table by phase, other than matrix, coating and void, of {words}, such as {example}",
        accepts,
        lambda value: {phase: float(entry) for phase, entry in value.items()},
        {
            "type": "object",
            "minProperties": 1,
            "patternProperties": {f"^({FIBRE_PHASE.pattern})$": number.json_schema},
            "additionalProperties": False,
        },
    )


def _is_fibre_or_fibres(value: Any) -> bool:
    is_list = isinstance(value, list) and value != [] and all(map(FIBRE.accepts, value))
    return value == "all" or FIBRE.accepts(value) or is_list


def _are_two_phases(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(text.accepts, value)) and value[0] != value[1]


def _are_openings(value: Any) -> bool:
    rising = is_number_list(value) and all(a < b for a, b in pairwise(value))
    return rising and value != [] and value[0] >= 0 and value[-1] <= 360


def _is_strength(value: Any) -> bool:
    return (is_number(value) and value > 0) or (isinstance(value, float) and value == math.inf)


def _positive_or_inf(what: str) -> ValueType:
    """A number above 0; inf is read as None."""
    schema = {"type": "number", "minimum": SMALLEST}
    return ValueType(f"{what} above 0, or inf", _is_strength, lambda v: None if v == math.inf else float(v), schema)


TABLE_FILE = ValueType("the name of a .csv file", _is_table_file, Path, {"type": "string", "pattern": "\\.csv$"})
CELL_FILE = ValueType(
    f"the name of a {MESH_FILE}, or of a .csv file of a table",
    _is_cell_file,
    Path,
    {"type": "string", "pattern": f"\\.({'|'.join(suffix[1:] for suffix in (*MESH_SUFFIXES, '.csv'))})$"},
)
FIBRE_LIST = ValueType(
    "a list of fibres such as {x = 0.5, y = 0.5, radius = 0.3}",
    _are_fibres,
    tuple,
    {
        "type": "array",
        "minItems": 1,
        "items": {
            "type": "object",
            "properties": {"phase": {"type": "string"}}
            | dict.fromkeys(("x", "y", "angle"), real().json_schema)
            | dict.fromkeys(("radius", "a", "b"), real(above=0.0).json_schema)
            | dict.fromkeys(("coating", "inner_radius", "sides", "corner"), real(least=0.0).json_schema),
            "required": ["x", "y"],
            "additionalProperties": False,
        },
    },
)
FRACTIONS = _by_phase("numbers above 0 and below 1", "{glass = 0.3, carbon = 0.25}", real(above=0.0, below=1.0))
RADII = _by_phase("numbers from 1e-9 to 1e9", "{glass = 6.0, carbon = 3.5}", real(least=1e-9, most=1e9))
FIBRES = ValueType(
    'the number of a fibre, counted from 1, a list of numbers, or "all"',
    _is_fibre_or_fibres,
    lambda v: v if v == "all" else tuple(v if isinstance(v, list) else [v]),
    {
        "anyOf": [
            {"const": "all"},
            FIBRE.json_schema,
            {"type": "array", "items": FIBRE.json_schema, "minItems": 1},
        ]
    },
)
KEPT = integer(least=2, most=10**9)
STATES = ValueType(
    f'"all", "peaks" or {KEPT.expected}',
    lambda v: v in ("all", "peaks") or KEPT.accepts(v),
    lambda v: v,
    {"anyOf": [{"enum": ["all", "peaks"]}, KEPT.json_schema]},
)
ARCS = ValueType(
    "a list of arcs {fibre, centre, angle}",
    lambda v: isinstance(v, list) and all(isinstance(arc, dict) for arc in v),
    tuple,
    {"type": "array", "items": {"$ref": "#/$defs/arc"}},
)
PAIR = ValueType(
    f"the names of two phases, such as {PAIR_EXAMPLE}",
    _are_two_phases,
    tuple,
    {**list_of(2, text.json_schema), "uniqueItems": True},
)
STRENGTH = _positive_or_inf("a traction")
STIFFNESS = _positive_or_inf("a stiffness")
TOUGHNESS = ValueType(
    "an energy per area above 0",
    lambda v: _is_strength(v) and v != math.inf,
    float,
    {"type": "number", "minimum": SMALLEST},
)
OPENINGS = ValueType(
    "a rising list of numbers from 0 to 360",
    _are_openings,
    to_floats,
    {
        "type": "array",
        "items": {"type": "number", "minimum": 0, "maximum": 360},
        "minItems": 1,
        "uniqueItems": True,
    },
)
STRAIN = ValueType(
    f"a list of three numbers {STRAIN_COMPONENTS}", lambda v: is_number_list(v, 3), to_floats, numbers(3)
)
LOAD = ValueType(
    "a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}",
    lambda v: isinstance(v, dict) and v != {},
    lambda v: v,
    {"$ref": "#/$defs/mixed_load", "minProperties": 1},
)
WAYPOINTS = ValueType(
    f"a list of strains {STRAIN_COMPONENTS} or of tables such as {{S11 = 60.0}}",
    lambda v: isinstance(v, list) and v != [] and all(is_number_list(load, 3) or LOAD.accepts(load) for load in v),
    tuple,
    {"type": "array", "items": {"anyOf": [numbers(3), LOAD.json_schema]}, "minItems": 1},
)
