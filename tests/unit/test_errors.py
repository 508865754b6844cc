"""Errors are lines of printable characters, not too long and not too many."""

import pickle

from feti_homog.errors import LONGEST_LINE, MOST_FAULTS, CaseError, escaped


def test_texts_of_errors_are_escaped_and_cut():
    words = "red\x1b[31m bell\x07 line\nend \u202eturned \udcff \x9b"
    assert CaseError(words).faults == (r"red\x1b[31m bell\x07 line\nend \u202eturned \udcff \x9b",)
    assert escaped("größe\n\tα", "\n\t") == "größe\n\tα"
    (line,) = CaseError(f"{'x' * 10**6}: too long").faults
    assert len(line) == LONGEST_LINE and "x...x" in line and line.endswith("x: too long")


def test_many_faults_are_counted_once():
    error = CaseError(*map(str, range(1000)))
    assert error.faults == (*map(str, range(MOST_FAULTS)), f"and {1000 - MOST_FAULTS} more faults")
    again = pickle.loads(pickle.dumps(error))
    assert again.faults == error.faults == CaseError(*error.faults).faults and str(again) == "\n".join(error.faults)
    assert len(CaseError(*map(str, range(MOST_FAULTS + 1))).faults) == MOST_FAULTS + 1


def test_faults_of_caught_errors_are_counted_with_the_others():
    inner = CaseError(*map(str, range(100)))
    placed = CaseError(*(f"[unknown] young: {fault}" for fault in inner.faults), "last")
    assert placed.faults[-2:] == ("[unknown] young: 19", "and 81 more faults")
    cases = CaseError(*(f"case-{k}: {fault}" for k in range(3) for fault in inner.faults))
    assert len(cases.faults) == MOST_FAULTS + 1 and cases.faults[-1] == "and 280 more faults"
    few = CaseError("first", *(f"[cell] {fault}" for fault in inner.faults[18:]))
    assert few.faults == ("first", "[cell] 18", "[cell] 19", "and 80 more faults")
