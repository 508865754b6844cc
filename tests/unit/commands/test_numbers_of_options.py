"""Numbers on the command line: what Python alone would take for one is refused."""

import pytest

from feti_homog.commands.parser import command_parser
from feti_homog.errors import CaseError


@pytest.mark.parametrize(
    "words",
    ["sweep a.toml --index 1_0", "sweep a.toml --out b --ranks-per-case 1_0", "sweep a.toml --index \u0663"],
)  # fmt: skip
def test_only_plain_numbers_are_taken(words):
    option = next(word for word in words.split() if word in ("--index", "--ranks-per-case"))
    with pytest.raises(CaseError, match=f"argument {option}: invalid"):
        command_parser().parse_args(words.split())


@pytest.mark.parametrize("word", ["8", "9x", "1x9", "9 x 7"])
def test_a_size_that_is_none_gets_an_example(word):
    assert command_parser().parse_args(["plot", "out", "--size", "9x7.5"]).size == (9.0, 7.5)
    with pytest.raises(CaseError, match=f"--size: '{word}': expected width and height of at least 2 cm, such as 9x7"):
        command_parser().parse_args(["plot", "out", "--size", word])
