"""The command line: `feti-homog run CASE.toml --out DIR`, `check CASE.toml`, `plot DIR`.

Options with a double dash are ours, with a single dash PETSc's.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from feti_homog import __version__
from feti_homog.errors import EXIT_DONE, CaseError
from feti_homog.options import help_text, split_argv

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


class Parser(argparse.ArgumentParser):
    """Whose errors are told once and give exit code 2, like those of the case."""

    def error(self, message: str) -> NoReturn:
        raise CaseError(f"command line: {message} (see --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command on all ranks; returns the exit code of DESIGN section 4."""
    return launch(_command, argv)


def launch(command: Callable[[Sequence[str], Intracomm], int], argv: Sequence[str] | None = None) -> int:
    """Start PETSc with its options among `argv` (default: the process's) and run command(the rest, world).

    Returns the exit code of `run_main`. For programs of their own, such as those in drivers/.
    """
    ours, petsc = split_argv(sys.argv[1:] if argv is None else argv)
    # Debian's h5py is the MPI build only if it is told so before its first import.
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"
    import petsc4py
    from mpi4py import MPI

    petsc4py.init([sys.argv[0], *petsc], comm=MPI.COMM_WORLD)
    from feti_homog.parallel import run_main

    return run_main(MPI.COMM_WORLD, lambda: command(ours, MPI.COMM_WORLD))


def parsed(parser: argparse.ArgumentParser, words: Sequence[str], comm: Intracomm) -> argparse.Namespace:
    """The arguments; help and version are printed once."""
    with contextlib.redirect_stdout(sys.stdout if comm.rank == 0 else io.StringIO()):
        return parser.parse_args(words)


def _command(words: Sequence[str], comm: Intracomm) -> int:
    arguments = parsed(_parser(), words or ["--help"], comm)
    arguments.action(arguments, comm)
    return EXIT_DONE


def _parser() -> Parser:
    parser = Parser(
        prog="feti-homog",
        description="Effective stiffness of fibre composites by FETI, on any number of MPI ranks.",
        epilog=f"PETSc's options, with a single dash:\n{help_text()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"feti-homog {__version__}")
    actions = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    run = actions.add_parser("run", help="run a case file and write its results to a folder")
    run.add_argument("case", type=Path, metavar="CASE.toml")
    run.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    run.add_argument("--resume", action="store_true", help="go on from where a path to the same folder was ended")
    run.set_defaults(action=_run)
    check = actions.add_parser("check", help="validate a case file, mesh its cell and print what would run")
    check.add_argument("case", type=Path, metavar="CASE.toml")
    check.set_defaults(action=_check)
    plot = actions.add_parser("plot", help="make the pictures of a results folder again")
    plot.add_argument("directory", type=Path, metavar="DIR")
    plot.set_defaults(action=_plot)
    return parser


def _run(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog import case as cases
    from feti_homog.output import folder
    from feti_homog.parallel import on_root
    from feti_homog.run import run

    case = on_root(comm, cases.load, arguments.case)
    if arguments.resume and case.path is None:
        raise CaseError(f'--resume: only for [analysis] type = "path"; this case has "{case.analysis.type}"')
    on_root(comm, folder.usable, arguments.out)
    run(case, arguments.out, comm, arguments.quiet, arguments.resume)


def _check(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog import case as cases
    from feti_homog.parallel import on_root, on_root_only
    from feti_homog.petsc_options import case_options
    from feti_homog.torn import describe

    case = on_root(comm, cases.load, arguments.case)
    with case_options(case.petsc):
        text = on_root_only(comm, describe, case, comm.size)
    if text is not None:
        print(text)


def _plot(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.output import plots
    from feti_homog.parallel import on_root_only

    for path in on_root_only(comm, plots.plot, arguments.directory) or []:
        print(path)
