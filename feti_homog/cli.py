"""Run the command line: options with a double dash belong to feti-homog, with a single dash to PETSc."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from feti_homog.api import parsed, start
from feti_homog.commands import parser
from feti_homog.errors import CaseError, ExitCode
from feti_homog.system.petsc import option_values
from feti_homog.typing import Intracomm

GONE = {"statistics": "is drivers/fibre_statistics.py now", "schema": "is gone: `feti-homog keys` has all keys"}
"""Removed commands, with their replacements."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command on all ranks (`verify` without MPI), and return the exit code."""
    words = sys.argv[1:] if argv is None else list(argv)
    ours, _ = option_values.split_argv(words)
    if ours[:1] == ["verify"]:
        from feti_homog.commands import verify

        return verify.verify(ours)
    return start(_command, words)


def _command(words: Sequence[str], comm: Intracomm) -> int:
    if words and words[0] in GONE:
        raise CaseError(f"command line: feti-homog {words[0]} {GONE[words[0]]}")
    from petsc4py import PETSc

    commands = parser.command_parser()
    # PETSc would silently accept our own options with a single dash.
    actions = next(action.choices for action in commands._actions if isinstance(action, argparse._SubParsersAction))
    ours = {name[2:] for action in actions.values() for name in action._option_string_actions if name.startswith("--")}
    if misplaced := sorted(ours & PETSc.Options().getAll().keys() - {"help"}):
        raise CaseError(*(f"command line: -{name} is not a PETSc option; did you mean --{name}?" for name in misplaced))
    arguments = parsed(commands, words or ["--help"], comm)
    module, _, name = arguments.action.partition(".")
    getattr(importlib.import_module(f"feti_homog.commands.{module}"), name)(arguments, comm)
    return ExitCode.DONE
