"""Keys, options and names that the documents give are those of the code."""

import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from feti_homog.case import reference
from feti_homog.system.petsc.option_table import unknown_options

ROOT = Path(__file__).parents[2]
FOLDERS = ("drivers", "feti_homog", "meshes", "scripts", "tests")
CASES = sorted(path for folder in ("drivers", "scripts") for path in (ROOT / folder).rglob("*.toml"))
DOCUMENTS = sorted([ROOT / "README.md", *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))])
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)

every_document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def code_words(document: Path) -> set[str]:
    """Return the text in backticks outside of code blocks."""
    return set(re.findall(r"`([^`\n]+)`", FENCE.sub("", document.read_text(encoding="utf-8"))))


@cache
def words_of_the_code() -> frozenset[str]:
    """All words of the programs, scripts, cases and meshes, and the names of all files."""
    files = [
        path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in ("", ".py", ".toml", ".geo")
    ]
    texts = [path.read_text(encoding="utf-8") for path in files if path.is_file()]
    names = [path.stem for folder in FOLDERS for path in (ROOT / folder).rglob("*")]
    return frozenset(word for text in (*texts, *names) for word in re.findall(r"--[\w-]+|\w+", text))


@cache
def keys() -> dict[str, set[str]]:
    """Return the keys of each section of a case file."""
    found: dict[str, set[str]] = {}
    for table in reference.tables():
        found.setdefault(table.section, set()).update(row.key for row in table.rows)
    return found


def unknown_keys(table: dict[str, object]) -> Iterator[str]:
    """Yield the keys of a case file, as it was read, that the reference does not have."""
    for section, content in table.items():
        if section not in keys():
            yield section
        elif isinstance(content, dict) and section not in ("petsc", "sweep"):
            parts = content.values() if section == "material" else [content]
            yield from (f"[{section}] {key}" for part in parts for key in part if key not in keys()[section])


@every_document
def test_sections_and_keys_in_documents_are_known(document):
    """`[section]` and `[section] key`."""
    named = re.findall(r"`\[([a-z]+)[^\]`]*\](?: (\w+))?`", document.read_text(encoding="utf-8"))
    assert not [(section, key) for section, key in named if key not in keys().get(section, set()) | {""}]
    assert {section for section, _ in named} <= set(keys())


@pytest.mark.parametrize("path", CASES, ids=lambda path: str(path.relative_to(ROOT)))
def test_keys_of_case_files_are_in_the_reference(path):
    assert not list(unknown_keys(tomllib.loads(path.read_text(encoding="utf-8"))))


@every_document
def test_options_in_documents_are_known(document):
    text = document.read_text(encoding="utf-8")
    named = set(re.findall(r"(?<![\w-])-(feti_\w*\w)(?!\w|\*|\.\.\.)", text))
    assert not unknown_options(named)
    ours = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", text))
    assert ours <= words_of_the_code()


@every_document
def test_names_of_the_code_in_documents_are_there(document):
    words = code_words(document)
    snake = {word for text in words for word in re.findall(r"(?<![\w/.-])[A-Za-z]\w*_\w+(?![\w/])", text)}
    assert {word for word in snake if not word.startswith("MPI_")} <= words_of_the_code()
