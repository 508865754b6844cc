"""Numbers on the command line: what Python alone would take for one is refused."""

import argparse

import pytest

from feti_homog.commands import studies


@pytest.mark.parametrize(
    "words",
    ["sweep a.toml --index 1_0", "sweep a.toml --out b --ranks-per-case 1_0", "sweep a.toml --index \u0663"],
)  # fmt: skip
def test_only_plain_numbers_are_taken(words, capsys):
    parser = argparse.ArgumentParser()
    studies.add(parser.add_subparsers())
    with pytest.raises(SystemExit):
        parser.parse_args(words.split())
    option = next(word for word in words.split() if word in ("--index", "--ranks-per-case"))
    assert f"error: argument {option}: " in capsys.readouterr().err
