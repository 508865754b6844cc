"""The limits that faults name are those that are checked: each is read from the words, and tried on both sides."""

import math
import re

import pytest

from feti_homog.case.load_sections import WAYPOINTS
from feti_homog.case.section_values import OPENINGS, STRAIN, STRENGTH
from feti_homog.case.sections import RANGE_KEYS, TABLES, SweepSection
from feti_homog.schema.keys import keys_of
from feti_homog.schema.types import LARGEST, MAGNITUDES, SMALLEST, real
from feti_homog.schema.wording import limit_in_words

WORDS = re.compile(r"(above|at least|below|at most) (\S+)")
TYPES = {
    f"{place} {name}": entry.type
    for place, keys in [
        *((table.place, keys_of(table.contents)) for table in TABLES),
        ("[sweep]", keys_of(SweepSection)),
        ("range", RANGE_KEYS),
    ]
    for name, entry in keys.items()
}
NUMBERS = {name: type_ for name, type_ in TYPES.items() if re.match(r"an? (number|integer)", type_.expected)}


def beside(limit, is_integer, towards):
    return int(limit) + int(math.copysign(1, towards)) if is_integer else math.nextafter(float(limit), towards)


@pytest.mark.parametrize("name", NUMBERS)
def test_limits_in_words_are_the_true_ones(name):
    type_ = NUMBERS[name]
    is_integer = type_.expected.startswith("an integer")
    limits = WORDS.findall(type_.expected)
    for word, text in limits:
        limit = int(text) if is_integer else float(text)
        outward = -math.inf if word in ("above", "at least") else math.inf
        assert type_.accepts(limit) == (word in ("at least", "at most"))
        assert not type_.accepts(beside(limit, is_integer, outward))
        inward = beside(limit, is_integer, -outward)
        # Next to 0 the limits of magnitudes hold, and are reported.
        assert type_.accepts(inward) or type_.complaint(inward).endswith(MAGNITUDES)
    words = {word for word, _ in limits}
    for end, named in ((-LARGEST, {"above", "at least"}), (LARGEST, {"below", "at most"})):
        end = int(end) if is_integer else end
        assert words & named or type_.accepts(end)
        assert words & named or MAGNITUDES in type_.complaint(end * 10)


@pytest.mark.parametrize("value", [SMALLEST / 2, -SMALLEST / 2, LARGEST * 2, -LARGEST * 2, math.inf, 10**400])
def test_limits_of_magnitudes_are_reported_where_they_are_what_is_wrong(value):
    assert real().complaint(value) == f"expected a number{MAGNITUDES}"
    assert STRAIN.complaint([0.0, value, 0.0]).endswith(MAGNITUDES)
    assert WAYPOINTS.complaint([[1.0, 0.0, 0.0], [0.0, value, 0.0]]).endswith(MAGNITUDES)
    assert OPENINGS.complaint([0.0, value]).endswith(MAGNITUDES)
    assert STRENGTH.complaint(value) == "" if value == math.inf else STRENGTH.complaint(value).endswith(MAGNITUDES)


@pytest.mark.parametrize("value", ["1", True, None, math.nan, [1.0], {}])
def test_they_are_not_told_where_something_else_is(value):
    assert real().complaint(value) == "expected a number"


@pytest.mark.parametrize("end", [SMALLEST, LARGEST])
def test_magnitudes_are_those_of_the_words(end):
    assert f"{end:g}" in MAGNITUDES and real().accepts(end) and real().accepts(-end)


@pytest.mark.parametrize("value", [0.91, 0.9069, 0.9068997, math.pi / math.sqrt(12)])
def test_a_rounded_limit_contradicts_the_value_that_it_refuses(value):
    assert value >= float(limit_in_words(math.pi / math.sqrt(12), value, 4))
