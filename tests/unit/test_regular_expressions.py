"""Regular expressions take steps in proportion to the length of a text: hostile texts are long."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.backtracking import LIMIT, Backtracking

pytestmark = pytest.mark.slow
PACKAGE = Path(__file__).parents[2] / "feti_homog"
METHODS = ("fullmatch", "match", "search", "split", "sub", "finditer", "findall")
FUNCTIONS = {f"re.{name}" for name in (*METHODS, "compile")}
# Patterns that are arguments of a function: (module, text of the argument).
ARGUMENTS = {
    ("mesh.readers.abaqus_file", "pattern"),
    ("studies.outputs", "re.sub('[A-Z]{3,}', '.+', pattern)"),  # of names of columns
    ("results.output_folder", "re.escape(target.name)"),  # of one name
    ("results.atomic", "f'({names.pattern})\\\\.(?P<tag>.+\\\\.\\\\d+)\\\\.part'"),  # of names in a folder
}
RUNS = (
    *" \t\n19aAe_-+.,:;=#$<>/'\"([{|\\x%!~\x00é",
    *("a.", "a .", '"" .', "' '.", "1.", ".1", "1e", "1e5", "-1", "1 ", "a ", " =", "= ", "a=", "#\n", "\n ", "[1]"),
    *("width", "width:", "width =", "width=1 ", "width = 1,", "<AppendedData", "</AppendedData", "_mm", "mm", "(mm"),
    *("[m", "C11", "E1", "S11_", "case-1", ".1.1"),
    *("$Nodes ", "$Nodes\n", "$a", '1 1 "', '1 1 "a"\n', "1 1 ", "1 2 3\n", "nan ", "1.5e-3 "),
)  # fmt: skip
ENDS, STARTS = ("", "!"), ("", '"')
REPEATS = (8, 16, 32)  # of a run: steps in proportion to the length double from one to the next


@cache
def expressions() -> dict[str, tuple[Any, set[str]]]:
    """Return the patterns of the package, and the methods with which they are applied, by module and line."""
    texts = {path: path.read_text() for path in sorted(PACKAGE.rglob("*.py"))}
    applied = set(re.findall(rf"\b(\w*)(?:\[[^]]*\])?\.({'|'.join(METHODS)})\(", "\n".join(texts.values())))
    found: dict[str, tuple[Any, set[str]]] = {}
    for path, text in texts.items():
        tree, name = ast.parse(text), ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        assignments = [(ast.unparse(n.targets[0]), n) for n in ast.walk(tree) if isinstance(n, ast.Assign)]
        assigned = {id(node): target for target, each in assignments for node in ast.walk(each)}
        calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute)]
        for call in calls:
            method = call.func.attr
            if ast.unparse(call.func) not in FUNCTIONS or (name, ast.unparse(first := call.args[0])) in ARGUMENTS:
                continue
            others = [ast.unparse(each) for each in (*call.args[1:], *(k.value for k in call.keywords))]
            flags = eval(" | ".join(each for each in others if each.startswith("re.")) or "0")
            uses = {method}
            if method == "compile":
                target = assigned.get(id(call), "")
                uses = {m for word, m in applied if word == target or not target} or {"fullmatch"}
            module = vars(importlib.import_module(f"feti_homog.{name}"))
            for choice in [first.body, first.orelse] if isinstance(first, ast.IfExp) else [first]:
                pattern = re.compile(eval(ast.unparse(choice), dict(module)), flags)
                found[f"{name}:{choice.lineno}:{choice.col_offset}"] = pattern, uses
    return found


def _short(text: Any) -> Any:
    """Return the text of a pattern with bounds of repeats below 100 cut to 3, which short texts exceed."""
    if isinstance(text, bytes):
        return _short(text.decode()).encode()
    return re.sub(r"(?<=[{,])\d\d?(?=[,}])", lambda bound: str(min(int(bound[0]), 3)), text)


def fault(pattern: Any, methods: set[str]) -> str:
    """Return the first text on which the steps of a pattern grow faster than the length."""
    short = re.compile(_short(pattern.pattern), pattern.flags)
    matcher = Backtracking(short)
    for method in sorted(methods):
        for start, run, end in ((start, run, end) for start in STARTS for run in RUNS for end in ENDS):
            texts = [f"{start}{run * count}{end}" for count in REPEATS]
            if isinstance(short.pattern, bytes):
                texts = [text.encode() for text in texts]
            first, second, third = (matcher.steps(method, text) for text in texts)
            if third == LIMIT or third - second > 3 * (second - first) + 9:
                return f"{method} of {start!r}, {run!r}..., {end!r}: {first}, {second}, {third} steps"
    return ""


def test_regular_expressions_are_linear():
    """All in one test: to find them takes seconds, which each process that collects cases would take."""
    faults = {name: fault(*own) for name, own in expressions().items()}
    assert len(faults) > 50 and not {name: line for name, line in faults.items() if line}


@pytest.mark.parametrize(
    "pattern", [r"\s*=", r"\d+x", r"(\w+ ?)+=", r"(\w|a)*=", r"(\w\w|a|\w)*=", r"a(?=.*x)", r"\w(?!.*x)"]
)
def test_regular_expressions_that_are_not_linear_are_found(pattern):
    assert fault(re.compile(pattern), {"search"})
