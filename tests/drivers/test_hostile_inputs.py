"""Bad inputs on one and two ranks: exit code 2 and one line each, before any work.

All of a number of ranks are tried in one job, one after the other, as a program that starts the command line.
"""

from __future__ import annotations

import json
import re

import pytest
from support.hostile_inputs import CASES, OPTIONS, write_inputs
from support.jobs import mpirun

EVERY = """
import json, sys
from pathlib import Path
from mpi4py import MPI
from feti_homog import cli

for name, words in json.loads(Path(sys.argv[1]).read_text()).items():
    if MPI.COMM_WORLD.rank == 0:
        print(f"== {name}", file=sys.stderr, flush=True)
    code = cli.main(words)
    if MPI.COMM_WORLD.rank == 0:
        print(f"-> {code}", file=sys.stderr, flush=True)
"""


@pytest.fixture(scope="module", params=[1, 2])
def answers(request, tmp_path_factory):
    """Return standard error of each command, its exit code in the last line, and the expected text."""
    folder = tmp_path_factory.mktemp(f"{request.param} ranks")
    commands = write_inputs(folder)
    (folder / "commands.json").write_text(json.dumps({name: words for name, (words, _) in commands.items()}))
    (folder / "every.py").write_text(EVERY)
    job = mpirun(request.param, folder / "every.py", folder / "commands.json")
    said = dict(re.findall(r"== (.*?)\n(.*?-> \S+)\n", job.stderr, re.DOTALL))
    assert "the case is valid" not in job.stdout
    return {name: (said.get(name, job.stderr).splitlines(), words) for name, (_, words) in commands.items()}


@pytest.mark.parametrize("name", [*OPTIONS, *CASES])
def test_they_end_with_2_and_one_line(answers, name):
    (*lines, code), words = answers[name]
    assert code == "-> 2" and len(lines) == 1, lines
    assert lines[0].startswith("error: ") and words in lines[0]
