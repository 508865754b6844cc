"""Columns of a sweep's table: those of a state under a load and of an envelope."""

import re
from typing import Any

from feti_homog.case import reference
from feti_homog.case.sections import TOP_LEVEL
from feti_homog.report.text.tables import unit
from feti_homog.studies.outputs import OUTPUT_COLUMNS, named, outputs
from feti_homog.system.runtime.records import STRESS


def document(factors: list[float | None], plane: tuple[str, str]) -> dict[str, Any]:
    points = [{"angle": 90.0 * k} | ({} if f is None else {"factor": f}) for k, f in enumerate(factors)]
    solver = dict.fromkeys(("ranks", "subdomains", "dofs", "multipliers"), 1) | {"iterations": [1]}
    return {
        "case": {"envelope": {"plane": list(plane)}}, "envelope": points, "solver": solver,
        "cell": {"fibre_fraction": 0.4, "elements": 1, "nodes": 1}, "checks": {}, "timings": {}, "memory": 1,
    }  # fmt: skip


def of_envelope(factors: list[float | None], plane: tuple[str, str] = ("S22", "S12")) -> dict[str, float]:
    return {name: value for name, value in outputs(document(factors, plane)).items() if name.startswith("envelope")}


def test_the_state_under_a_load_has_columns():
    point = {
        "strain": [0.1, -0.02, 0.0],
        "stress": [5.0, 0.0, 0.0],
        "stored": 0.25,
        "bonded": 9,
        "open": 1,
        "closed": 0,
    }
    base = document([], ("S22", "S12")) | {"load": point}
    found = outputs(base)
    assert found["load_E11"] == 0.1 and found["load_S11"] == 5.0 and found["load_open"] == 1.0
    assert unit("load_S11", "GPa") == "GPa" == unit("load_stored", "GPa") and unit("load_E11", "GPa") == ""


def test_a_name_finds_the_columns_that_stand_for_it_and_entries():
    names = {**of_envelope([5.0, 2.0, 9.0, 3.0]), **outputs(document([], ("S22", "S12")))}
    assert all(named(name) for name in names)
    heads = {name: [line.partition(":")[0] for line in named(name)] for name in ("peak_S22", "peak_E11", "softened")}
    assert heads == {"peak_S22": ["cases.csv, peak_Sij"], "peak_E11": ["cases.csv, peak_STRAIN"],
                     "softened": ["result.json, softened"]}  # fmt: skip
    assert named("peak_S2") == named("nothing") == named("") == []
    (table,) = reference.tables("peak_S22", named("peak_S22")) or [None]
    assert table is None and reference.text("peak_S22", named("peak_S22")).startswith("cases.csv, peak_Sij: largest")


def test_columns_of_envelopes_are_the_first_axis_the_least_and_the_largest():
    found = of_envelope([5.0, 2.0, 9.0, 3.0])
    assert found == {"envelope_S22": 5.0, "envelope_least_S22_S12": 2.0, "envelope_largest_S22_S12": 9.0}
    assert {unit(name, "MPa") for name in found} == {"MPa"}
    found = of_envelope([5.0, 2.0, 9.0, 3.0], ("E11", "gamma12"))
    assert len(found) == 3 and {unit(name, "MPa") for name in found} == {""}
    assert of_envelope([None, 2.0, 9.0, 3.0]) == {"envelope_least_S22_S12": 2.0}
    assert of_envelope([None] * 4) == {}


def test_every_column_has_the_unit_of_its_reference():
    """Of stresses, plain numbers, seconds and bytes; of a temperature nobody says the unit."""
    examples = {
        "Cij": "C12", "Cii": "C33", "Sij": "S13", "STRAIN": "gamma12", "ANGLE": "60", "STATUS": "open", "LAW": "hill",
        "STAGE": "solve", "PHASE": "fibre",
    }  # fmt: skip
    given = {STRESS: "GPa", "": "", "s": "s", "bytes": "bytes"}
    pattern, wrong = re.compile("|".join(examples)), {}
    columns = [column for column in OUTPUT_COLUMNS if column.unit in given]
    for column in columns:
        name = pattern.sub(lambda found: examples[found[0]], column.name)
        if unit(name, "GPa") != given[column.unit]:
            wrong[column.name] = unit(name, "GPa")
    assert not wrong and len(columns) > 60


def test_every_key_of_a_case_that_is_a_stress_has_its_unit():
    """Keys of other dimensions have none, but angles."""
    given = {"stress": "GPa", "degrees": "degrees"}
    tables = [table for table in reference.tables() if table.section in TOP_LEVEL]
    keys = {f"{table.section}.name.{row.key}": row.unit for table in tables for row in table.rows}
    found = {name: unit(name, "GPa") for name in keys}
    assert found == {name: given.get(own, "") for name, own in keys.items()} and "GPa" in found.values()
