"""Deliberate errors of tests/mutations.toml have one place each, and tests: `scripts/mutations.py` tries them all."""

import shlex
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
GROUPS = tomllib.loads((ROOT / "tests/mutations.toml").read_text(encoding="utf-8"))["group"]


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group["tests"])
def test_each_error_has_its_one_place_and_tests(group):
    for name, old, new in group["lines"]:
        text = (ROOT / name).read_text(encoding="utf-8")
        assert text.count(old) == 1 and old != new, f"{name}: {old}"
        compile(text.replace(old, new), name, "exec")
    files = [word for word in shlex.split(group["tests"]) if word.startswith("tests/")]
    assert all((ROOT / file).exists() for file in files)
    assert files or group["tests"].startswith("hostile ")
