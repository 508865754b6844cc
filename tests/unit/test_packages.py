"""Docstrings of packages: what they import and their main entries, as the code has them."""

import ast
import re

import pytest
from unit.test_architecture import MODULES, PACKAGE, imported_names, name_of, nodes

PACKAGES = {name_of(path).removesuffix("__init__").rstrip("."): path for path in PACKAGE.rglob("__init__.py")}
DESCRIBED = sorted(set(PACKAGES) - {""})
LARGEST_FACE = 12
EVERYWHERE = {"errors", "typing", "__version__"}  # modules that every package may import


def described(package: str) -> str:
    return " ".join(ast.get_docstring(ast.parse(PACKAGES[package].read_text(encoding="utf-8"))).split())


def package_of(name: str) -> str:
    """Return the innermost package of a dotted name; of a module beside the packages the module."""
    words = name.split(".")
    return next((found for n in range(len(words), 0, -1) if (found := ".".join(words[:n])) in PACKAGES), words[0])


def imported_packages(package: str) -> set[str]:
    """Return the packages that the modules of one import: others by their first name, its neighbours in full."""
    found = {package_of(name) for path in PACKAGES[package].parent.glob("*.py") for name in imported_names(path)}
    top = package.split(".")[0]
    return {name if name.split(".")[0] == top else name.split(".")[0] for name in found - {package}} - EVERYWHERE


@pytest.mark.parametrize("package", DESCRIBED)
def test_packages_name_what_they_import(package):
    if len(list(PACKAGES[package].parent.glob("*.py"))) > 1:
        (sentence,) = re.findall(r"Imports (.*?)\.(?= |$)", described(package))
        assert set(re.findall(r"`([\w.]+)`", sentence)) == imported_packages(package)


@pytest.mark.parametrize("package", DESCRIBED)
def test_main_entries_exist(package):
    entries = re.findall(r"`([a-z_]+(?:\.\w+)*)`", described(package).split("Main entr")[1])
    assert entries
    for entry in entries:
        words, place = entry.split("."), PACKAGES[package].parent
        while words and (place / words[0]).is_dir():
            place /= words.pop(0)
        if words and (file := place / f"{words[0]}.py").is_file():
            tops = ast.parse(file.read_text(encoding="utf-8")).body
            names = {name for node in tops for name in [getattr(node, "name", None), *_targets(node)]}
            assert set(words[1:2]) <= names, f"{package}: {entry}"
        else:
            assert not words or entry.startswith("feti-homog"), f"{package}: {entry}"


def _targets(node: ast.stmt) -> list[str]:
    targets = [*getattr(node, "targets", []), getattr(node, "target", None)]
    return [target.id for target in targets if isinstance(target, ast.Name)]


def test_packages_import_from_faces_alone():
    """No package imports a name of another package, or subpackage, that its `__all__` lacks."""
    faces = {
        package: set(ast.literal_eval(node.value))
        for package, path in PACKAGES.items()
        for node in nodes(path, ast.Assign, words="__all__")
        if ast.unparse(node.targets[0]) == "__all__"
    }
    faces.pop("")
    assert {name: len(face) for name, face in faces.items() if len(face) > LARGEST_FACE} == {}
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    hidden = {
        f"{name_of(path)}: {name}"
        for path in MODULES
        for name in imported_names(path)
        if name.split(".")[0] in packages - {name_of(path).split(".")[0]}
        and name not in packages
        and name.rpartition(".")[2] not in faces.get(name.rpartition(".")[0], ())
    }
    assert not {line for line in hidden if not line.startswith("__init__:")}
