"""Links, files, modules, commands and case files of the documents exist; their recipe for a mesh works."""

import argparse
import ast
import re
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from feti_homog.case.cases import parse
from feti_homog.case.sections import SWEEP
from feti_homog.commands.parser import command_parser
from feti_homog.mesh.readers import msh_reader
from feti_homog.mesh.tiles.tile_filling import gmsh_session
from feti_homog.studies import sweep_cases

ROOT = Path(__file__).parents[2]
PLACES = ("drivers", "feti_homog", "meshes", "scripts", "tests")
DOCUMENTS = [ROOT / "README.md", *(ROOT / f"{place}/README.md" for place in PLACES), ROOT / "feti_homog/THEORY.md"]
# What scripts and runs make, and names that stand for the reader's own.
MADE = re.compile(r"results/|build/|.*DIR|.*\.\.\.")
# A dotted name below the package, and an attribute of it in brackets; files that runs write look alike.
SYMBOL = re.compile(r"`([a-z_]+(?:\.(?!csv|h5|json|png|toml|xdmf)[a-z_]+)+(?:\.[A-Z]\w*)?)`(?: \(`(\w+)`)?")

WIDTH = 100
# A list's mark, then one formula, one piece of code, one link or one word: nowhere to break the line.
UNBREAKABLE = re.compile(r"\s*(?:(?:[-*]|\d+\.) )?(?:\$[^$]*\$|`[^`]*`|\[[^\]]*\]\([^)]*\)|\S)+")

documents = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def prose(path):
    """Return the text without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def lines_of_prose(text):
    """Return the lines that are no table, heading, picture, display formula or fenced block."""
    blocks = re.compile(r"^\s*```.*?^\s*```$|^\s*\$\$.*?\$\$", flags=re.MULTILINE | re.DOTALL)
    return [line for line in blocks.sub("", text).splitlines() if not line.startswith(("|", "#", "!["))]


def too_long(text):
    """Return the lines of prose that are longer than the width and could be broken."""
    return [line for line in lines_of_prose(text) if len(line) > WIDTH and not UNBREAKABLE.fullmatch(line)]


def blocks(path, language):
    """Return the fenced blocks of a language."""
    text = path.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


@cache
def anchors(path):
    """Return the anchors of a document's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", prose(path), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@cache
def names_in(module):
    """All names that a module defines or mentions."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    fields = ("name", "id", "attr", "arg")
    return {value for node in ast.walk(tree) for field in fields if isinstance(value := getattr(node, field, 0), str)}


def module_of(dotted):
    """Return the file of a dotted name below the package, and the names after it.

    A package, a module, or names in one.
    """
    words = dotted.removeprefix("feti_homog.").split(".")
    place = ROOT / "feti_homog"
    while words and (place / words[0]).is_dir():
        place /= words.pop(0)
    if words and (place / f"{words[0]}.py").is_file():
        return place / f"{words[0]}.py", words[1:]
    return place / "__init__.py", words


def test_the_first_page_and_the_changelog_are_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 1400
    assert len((ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()) <= 69


@documents
def test_prose_is_wrapped(path):
    assert not too_long(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "ends", [("", ""), ("```\n", "\n```"), ("$$\n", "\n$$"), ("| ", " |"), ("## ", ""), ("![", "](a.png)")]
)
def test_lines_of_prose_alone_are_too_long(ends):
    line = WIDTH // 2 * "a " + "b"
    assert too_long(line.join(ends)) == ([line] if ends == ("", "") else [])


@pytest.mark.parametrize("token", ["`{}`", "[{}](a.md)", "${}$"])
def test_a_token_may_be_longer_than_a_line(token):
    token = token.format(WIDTH // 2 * "a " + "b")
    assert not too_long(f"- {token},") and too_long(f"- see {token}")


@documents
def test_links_lead_somewhere(path):
    missing = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if target.startswith(("http://", "https://")):
            continue
        file, _, anchor = target.partition("#")
        place = (path.parent / file).resolve() if file else path
        if not place.exists() or (anchor and anchor not in anchors(place)):
            missing.append(target)
    assert not missing


@documents
def test_files_that_are_named_exist(path):
    text = path.read_text(encoding="utf-8")
    # Not the middle of a longer path, of a web address or of a relative link, which the test of links sees.
    named = re.findall(rf"(?<![\w/.\-])((?:{'|'.join(PLACES)})/[\w./\-]+)", text)
    named = [name.rstrip("./") for name in named if not MADE.fullmatch(name)]
    assert not [name for name in named if not (ROOT / name).exists()]


@documents
def test_modules_and_their_names_exist(path):
    missing = []
    for dotted, attribute in SYMBOL.findall(prose(path)):
        if dotted != "report.html" and (ROOT / "feti_homog" / dotted.split(".")[0]).is_dir():
            module, names = module_of(dotted)
            names = [*names, *([attribute] if attribute else [])]
            if not module.is_file() or set(names) - names_in(module):
                missing.append((dotted, attribute))
    assert not missing


@documents
def test_commands_exist(path):
    actions = command_parser()._actions
    known = next(set(action.choices) for action in actions if isinstance(action, argparse._SubParsersAction))
    named = re.findall(r"(?:feti-homog|-m feti_homog) ([a-z]+)", path.read_text(encoding="utf-8"))
    assert set(named) <= known


@documents
def test_case_files_are_valid(path):
    for block in blocks(path, "toml"):
        document = tomllib.loads(block)
        if "analysis" not in document:
            assert set(document) <= {"cell"}
        elif SWEEP in document:
            assert len(sweep_cases.expand(document, path.parent).cases) > 1
        else:
            parse(document, path.parent if path.parent != ROOT else ROOT)


@documents
def test_programs_are_python(path):
    for block in blocks(path, "python"):
        compile(block, str(path), "exec")


@pytest.mark.parametrize("name", ["hexagonal", "two_fibres", "sweep"])
def test_case_files_in_the_documents_are_those_of_the_drivers(name):
    shown = [tomllib.loads(block) for path in DOCUMENTS for block in blocks(path, "toml")]
    document = tomllib.loads((ROOT / f"drivers/{name}.toml").read_text(encoding="utf-8"))
    assert document in shown


def test_the_first_case_file_is_shown_word_for_word():
    assert (ROOT / "drivers/hexagonal.toml").read_text(encoding="utf-8") in blocks(ROOT / "README.md", "toml")


def test_the_recipe_for_a_mesh_is_the_file_and_is_read(tmp_path):
    source = ROOT / "meshes/two_fibres.geo"
    assert blocks(ROOT / "meshes/README.md", "geo") == [source.read_text(encoding="utf-8")]
    with gmsh_session() as gmsh:
        gmsh.open(str(source))
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "two_fibres.msh"))
    mesh = msh_reader.read(tmp_path / "two_fibres.msh")
    assert mesh.phases == ("matrix", "fibre", "fibre:2")
    # A circle and an ellipse.
    assert len(mesh.debonded_edges) and np.all(mesh.ellipses.circles[0] == pytest.approx([1.5, 0.5, 0.3]))
    assert len(mesh.ellipses) == 2 and set(mesh.arc_circle) == {0, 1}
