"""Pages of the manual that are made from the code: commands, keys of case files, PETSc's options, what is written."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from feti_homog import errors
from feti_homog.cli import command_parser
from feti_homog.common.petsc_option_table import OPTIONS

ERRORS = (errors.FetiHomogError, errors.CaseError, errors.MeshError, errors.ConvergenceError)


def write(folder: Path) -> None:
    """Writes every page to the folder, under its name."""
    folder.mkdir()
    for name, page in PAGES.items():
        (folder / f"{name}.md").write_text(page(), encoding="utf-8")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; the first column is code."""
    lines = [head, ["---"] * len(head), *((f"`{first}`", *rest) for first, *rest in rows)]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def command_line() -> str:
    """All commands with their arguments, and the exit codes."""
    parts = ["# Command line", _console(command_parser().format_help())]
    for name, parser in _commands():
        parts += [f"## feti-homog {name}", _console(parser.format_help())]
    codes = [(str(errors.EXIT_DONE), "done; every check is within its tolerance")]
    codes += [(str(error.exit_code), f"{error.__doc__}") for error in ERRORS]
    return "\n\n".join([*parts, "## Exit codes", table(["exit code", "meaning"], sorted(codes))])


def _commands() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in command_parser()._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def _console(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```"


def petsc_options() -> str:
    rows = [(f"-{option.name}", _choices(option.value), _choices(option.default), option.help) for option in OPTIONS]
    words = (
        "Options of the solver, on the command line, or without the dash in the section `[petsc]` of a case file; "
        "the command line has precedence. `feti-homog options` prints them."
    )
    return "\n\n".join(["# PETSc options", words, table(["option", "takes", "default", "meaning"], rows)])


def _choices(words: str) -> str:
    return ", ".join(f"`{word}`" for word in words.split("|") if word)


PAGES: dict[str, Callable[[], str]] = {
    "command_line": command_line,
    "petsc_options": petsc_options,
}
