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
