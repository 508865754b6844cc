"""Pages of the manual that are made from the code: commands, keys of case files, options and results."""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

from markdown_text import capitalised, code, page, plain, table
from results_page import results

from feti_homog import errors
from feti_homog.case import reference
from feti_homog.commands.parser import command_parser
from feti_homog.system.petsc.option_table import OPTIONS

ERRORS = (errors.FetiHomogError, errors.CaseError, errors.MeshError, errors.ConvergenceError)


def write(folder: Path) -> None:
    """Write every page to the folder, under its name."""
    folder.mkdir()
    for name, text in PAGES.items():
        (folder / f"{name}.md").write_text(text(), encoding="utf-8")


def command_line() -> str:
    """Return the page on all commands, their arguments and the exit codes."""
    parts = ["# Command line", _console(command_parser().format_help())]
    for name, parser in _commands():
        parts += [f"## feti-homog {name}", _console(parser.format_help())]
    codes = [(str(errors.ExitCode.DONE), "done; every check is within its tolerance")]
    codes += [(str(error.exit_code), f"{error.__doc__}") for error in ERRORS]
    return page(*parts, "## Exit codes", table(["exit code", "meaning"], sorted(codes)))


def case_file() -> str:
    """Return the page on the keys of every table of a case file."""
    parts = [
        "# Case file",
        "A case file is TOML. `feti-homog keys` prints these tables, after an index that lists keys by need. "
        "`feti-homog keys WORD` prints the keys and sections that contain a word.",
    ]
    for each in reference.tables():
        rows = [(code(r.key), _accepts(r), r.default, r.applies, r.meaning) for r in each.rows]
        parts += [f"## {plain(capitalised(each.place))}", plain(capitalised(each.meaning))]
        parts.append(table(["key", "accepts", "default", "applies if", "meaning"], rows))
    return page(*parts)


def petsc_options() -> str:
    """Return the page on the PETSc options that the solver takes."""
    words = (
        "Options of the solver. Give them on the command line, or, without the dash, in the section `[petsc]` of a "
        "case file; the command line has precedence. `feti-homog options` prints this table."
    )
    rows = [(code(f"-{o.name}"), _choices(o.value), _choices(o.default), o.help) for o in OPTIONS]
    return page("# PETSc options", words, table(["option", "takes", "default", "meaning"], rows))


PAGES: dict[str, Callable[[], str]] = {
    "command_line": command_line,
    "case_file": case_file,
    "petsc_options": petsc_options,
    "results": results,
}


def _console(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```"


def _choices(words: str) -> str:
    return ", ".join(code(word) for word in words.split("|") if word)


def _accepts(row: reference.KeyRow) -> str:
    return f"{row.accepts} ({row.unit})" if row.unit else row.accepts


def _commands() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in command_parser()._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()
