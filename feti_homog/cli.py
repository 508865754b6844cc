"""The command line, `feti-homog COMMAND ...`.

Options with a double dash are ours, with a single dash PETSc's.
"""

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn

from feti_homog.api import parsed, start
from feti_homog.commands import products, run, studies
from feti_homog.errors import EXIT_DONE, CaseError
from feti_homog.system.petsc import option_table, option_values
from feti_homog.typing import Intracomm
from feti_homog.version import __version__

LAUNCHER_HELP = "Switches of Open MPI go to mpirun: --allow-run-as-root, --oversubscribe (more ranks than cores)."
GONE = {"statistics": "is drivers/fibre_statistics.py now", "schema": "is gone: `feti-homog keys` has all keys"}
"""Removed commands, each with its replacement."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are reported once, with exit code 2, as errors of the case."""

    def error(self, message: str) -> NoReturn:
        raise CaseError(f"command line: {message} (see --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command on all ranks, `verify` without MPI; returns the exit code of `errors`."""
    words = sys.argv[1:] if argv is None else list(argv)
    ours, _ = option_values.split_argv(words)
    return products.run_verify(command_parser(), ours) if ours[:1] == ["verify"] else start(_command, words)


def _command(words: Sequence[str], comm: Intracomm) -> int:
    if words and words[0] in GONE:
        raise CaseError(f"command line: feti-homog {words[0]} {GONE[words[0]]}")
    from petsc4py import PETSc

    parser = command_parser()
    # PETSc would take our own options with a single dash without a word.
    actions = next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    ours = {name[2:] for action in actions.values() for name in action._option_string_actions if name.startswith("--")}
    if misplaced := sorted(ours & PETSc.Options().getAll().keys() - {"help"}):
        raise CaseError(*(f"command line: -{name} is no option of PETSc; did you mean --{name}?" for name in misplaced))
    arguments = parsed(parser, words or ["--help"], comm)
    arguments.action(arguments, comm)
    return EXIT_DONE


def command_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(
        prog="feti-homog",
        description="Effective stiffness of fibre composites by FETI, on any number of MPI ranks.",
        epilog=f"{option_table.help_text()}\n\n{LAUNCHER_HELP}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"feti-homog {__version__}")
    actions = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    for add in (run.add, products.add, products.add_fibres, studies.add, run.add_reference):
        add(actions)
    return parser
