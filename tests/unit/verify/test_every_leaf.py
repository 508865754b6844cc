"""One false number of result.json, resealed, breaks a law, or the certificate says that it is not checked."""

import copy
import json
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from support.falsifications import broken, resealed

from feti_homog.errors import CaseError
from feti_homog.verify.certificate import DAMAGE, checks_of, laws_of_fields, laws_of_numbers, verify
from feti_homog.verify.check_mesh import check_interface, check_mesh
from feti_homog.verify.check_state import check_phases
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, Section
from feti_homog.verify.reading import opened

pytestmark = pytest.mark.slow

# Kinds of results, and of how many entries of one name, the first and the last among them, each is falsified; with 0
# the last alone: all laws of bonds that soften take a second.
KINDS = {
    "bonded": 99, "contact": 3, "derivatives": 1, "derivatives under contact": 3, "friction": 1, "softening": 0,
    "friction by steps": 1, "thinned": 1, "envelope in space": 1, "angle": 3, "load": 9, "load with contact": 9,
}  # fmt: skip
CHANGE, ROUNDING = 1e-2, 1e-12


def numbers(value, place=()):
    """Yield the places of all numbers and words but those of the case, which both files have, and these."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if place or key != "case":
                yield from numbers(inner, (*place, key))
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from numbers(inner, (*place, number))
    elif value is not None:
        yield place, value


def name_of(place):
    words = "".join("[]" if isinstance(key, int) else f".{key}" for key in place)
    return words.removeprefix(".")


def false(value, size):
    """Return another value, well beyond rounding."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return f"{value}?"
    return value + 1 if isinstance(value, int) else value + CHANGE * (size if size > ROUNDING else 1.0)


def chosen(document, most):
    """Yield places and false values; of one name of points, at most so many, the first and the last among them."""
    leaves = list(numbers(document))
    count, seen, sizes = Counter(name_of(place) for place, _ in leaves), Counter(), {}
    for place, value in leaves:
        if isinstance(value, float):
            sizes[name_of(place)] = max(abs(value), sizes.get(name_of(place), 0.0))
    for place, value in leaves:
        name = name_of(place)
        seen[name] += 1
        is_between = most and (seen[name] == 1 or seen[name] % max(count[name] // most, 1) == 0)
        if is_between or seen[name] == count[name]:
            size = sizes.get(name, 0.0)
            if place[1:2] == ("derivatives",):  # beside the largest of its constant, for one relative change
                data = document["sensitivities"]
                row, values = np.array(data["derivatives"][place[2]]), np.array(data["parameter_values"])
                size = float(np.abs(row * values).max() / abs(values[place[3]])) or 1.0
            yield name, place, false(value, size)


def changed(document, place, value):
    edited = copy.deepcopy(document)
    inner = edited
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return edited


def checked(findings, cell, numbers, states):
    """Yield after each group of laws on result.json; laws on fields come last."""
    yield laws_of_numbers(findings, cell, numbers)
    yield check_mesh(findings, cell), check_interface(findings, cell)
    for number, state in enumerate(states):
        yield check_phases(findings, cell, state, number)


@pytest.mark.parametrize("kind", KINDS)
def test_a_false_number_is_noticed_or_listed(results, kind):
    folder = results(kind)
    document = json.loads((folder / "result.json").read_text())
    listed = {name for names in verify(folder).unchecked.values() for name in names}
    of_files = {"schema", "checksum", "result_h5"}
    with opened(folder) as files, np.errstate(all="ignore"):
        cell, states = DiscreteCell.of(files), list(files.states())
        numbers_of_states = laws_of_fields(Findings(checks_of(cell)), cell)
        for name, place, value in chosen(document, KINDS[kind]):
            if {re.sub(r"(\[\])+$", "", name), place[0]} & (listed | of_files):
                continue
            edited = replace(cell, files=replace(files, document=Section(changed(document, place, value))))
            findings = Findings(checks_of(edited))
            try:
                parts = checked(findings, edited, numbers_of_states, states)
                assert any(not finding.holds for _ in parts for finding in findings.worst()), (place, value)
            except DAMAGE:
                continue  # which is reported in one line


def test_a_false_seal_is_noticed(results, tmp_path):
    document = json.loads((results("bonded") / "result.json").read_text())
    wrong = changed(document, ("result_h5", "bytes"), document["result_h5"]["bytes"] + 1)
    assert broken(resealed(results("bonded"), tmp_path / "bytes", wrong)) == {"files"}
    with pytest.raises(CaseError, match="no result of this version"):
        verify(resealed(results("bonded"), tmp_path / "schema", document | {"schema": 2}))


def test_a_tolerance_that_the_case_does_not_name_is_listed(results, tmp_path):
    """It may be of the command line; the tolerance of the checks follows from it."""
    document = json.loads((results("plane") / "result.json").read_text())
    document["solver"]["rtol"], document["check_tolerance"] = 1e-9, 1e-6
    certificate = verify(resealed(results("plane"), tmp_path / "copy", document))
    assert certificate.holds and any("solver.rtol" in names for names in certificate.unchecked.values())


def test_the_names_of_entries_take_memory_in_proportion_to_the_points() -> None:
    """Each of 20 000 points holds its own names alone: all names in each would be 800 million."""
    document = Section({"path": [{"work": float(k), "stored": 0.0} for k in range(20_000)]})
    points = document.hint("path")
    assert len(document.places) == 40_000 and not any(point.places for point in points)
    assert points[7]["work"] == 7.0 and "path[7].work" not in document.unread and "path[8].work" in document.unread
