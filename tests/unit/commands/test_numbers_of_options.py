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
