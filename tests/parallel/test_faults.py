"""Faulty cases and meshes through the command line, by all ranks together: reported once, nothing written.

`check` and `run`, whose folder must not be made, meet one fault of each class; unit tests have all of them.  A class
are the faults of a section that name something missing, unknown, or expected otherwise; of other faults, and of meshes,
those whose words begin alike.
"""

import re
from collections.abc import Mapping
from typing import Any

import pytest
from support.base_case import BASE
from support.ranks import parallel_assert
from unit.case.faulty_bonding import FAULTY_BONDINGS
from unit.case.faulty_cases import FAULTY_CASES
from unit.case.faulty_envelopes import FAULTY_ENVELOPES
from unit.mesh.faulty_meshes import FAULTY_MESHES, write_faulty

from feti_homog import cli

pytestmark = pytest.mark.parallel

FAULTY = FAULTY_CASES | FAULTY_BONDINGS | FAULTY_ENVELOPES
CELL = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05'
MESH_CASE = BASE.replace(CELL, 'geometry = "mesh"\nfile = "faulty.msh"')
RANDOM = 'geometry = "random"\nfibres = 30\n'
# The case is read first, and reports it in its own words.
BY_CASE = {"cannot be read": "no such file"}


def fault_class(message: str) -> tuple[str, ...]:
    """Section and kind of a fault, or its first word."""
    section = re.match(r"\[.*?\]", message)
    kinds = [word for word in ("missing", "unknown", "expected") if word in message]
    return (section.group(), *kinds[:1]) if section else (message.split()[0],)


def by_command(messages: Mapping[Any, str]) -> list[tuple[str, Any]]:
    """Commands with the names of the faults that they meet, the first of each class."""
    first: dict[tuple[str, ...], Any] = {}
    for name, message in messages.items():
        first.setdefault(fault_class(message), name)
    return [(command, name) for command in ("check", "run") for name in first.values()]


@pytest.mark.parametrize(("command", "name"), by_command({words: words for words in FAULTY}))
def test_faulty_cases_are_refused_on_every_rank_and_told_once(comm, shared_path, capsys, command, name):
    if comm.rank == 0:
        (shared_path / "cell.toml").write_text(FAULTY[name], encoding="utf-8")
    refused(comm, shared_path, capsys, command, name.splitlines())


@pytest.mark.parametrize(("command", "number"), by_command({k: words for k, (words, _) in enumerate(FAULTY_MESHES)}))
def test_faulty_meshes_are_refused_on_every_rank_and_told_once(comm, shared_path, capsys, command, number):
    message, mesh = FAULTY_MESHES[number]
    if comm.rank == 0:
        (shared_path / "cell.toml").write_text(MESH_CASE)
        write_faulty(mesh, shared_path / "faulty.msh")
    refused(comm, shared_path, capsys, command, [BY_CASE.get(message, message)])


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("fibre_fraction = 0.95", "fibre_fraction = 0.95: expected less than 0.9069"),
        (f"{RANDOM}fibre_fraction = 0.745\nmin_gap = 0.1", "lower one of them"),
    ],
)
def test_cells_that_cannot_be_made_are_refused(comm, shared_path, capsys, cell, message):
    own = [line.split(" = ")[0] for line in cell.splitlines()]
    lines = [line for line in CELL.splitlines() if line.split(" = ")[0] not in own]
    if comm.rank == 0:
        (shared_path / "cell.toml").write_text(BASE.replace(CELL, "\n".join([*lines, cell])))
    refused(comm, shared_path, capsys, "run", [message])


def test_there_are_enough_faults():
    assert len(FAULTY) + len(FAULTY_MESHES) >= 240
    assert 30 < len(set(map(fault_class, FAULTY))) < len(FAULTY) / 4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rum"], "invalid choice: 'rum'"),
        (["run"], "the following arguments are required: CASE.toml, --out"),
        (["run", "none.toml"], "the following arguments are required: --out"),
        (["run", "none.toml", "--out", "results/none"], "none.toml: cannot be read: No such file"),
        (["run", "none.toml", "--out", "results/none", "--quite"], "unrecognized arguments: --quite"),
        (["fit", "none.toml", "--out", "results/none", "--resume"], "--resume; without it, the same command resumes"),
        (["check", "."], "cannot be read: Is a directory"),
    ],
)
def test_faulty_commands_are_refused_on_every_rank_and_told_once(comm, capsys, words, message):
    assert cli.main(words) == 2
    told_once(comm, capsys, [message])


def refused(comm, folder, capsys, command, expected):
    """Check that the command ends with exit code 2 on every rank, and that rank 0 prints a line per fault."""
    comm.barrier()
    out = ["--out", str(folder / "results")] if command == "run" else []
    before = sorted(folder.iterdir())
    code = cli.main([command, str(folder / "cell.toml"), *out])
    parallel_assert(comm, code == 2, f"exit code {code}")
    assert sorted(folder.iterdir()) == before
    told_once(comm, capsys, expected)


def told_once(comm, capsys, expected):
    errors = capsys.readouterr().err
    lines = errors.splitlines()
    if comm.rank == 0:
        missing = [words for words in expected if words not in errors]
        good = not missing and all(line.startswith("error: ") for line in lines)
        good = good and len(set(lines)) == len(lines)
    else:
        good = not lines
    parallel_assert(comm, good, errors)
