"""kill -9 of one rank while files are written: the others end, what is there is no result yet, and --resume goes on."""

from __future__ import annotations

import json

from support.command_line import command_line
from support.jobs import mpirun
from support.small_path import PATH

# The command line, with one rank killed when it is about to give a file its name, or to write a state.
SABOTAGED = """
import os, signal, sys
from feti_homog import api, cli

def launch(comm):
    from feti_homog.output.files import atomic
    from feti_homog.output.files.field_file import FieldFile
    commit, write_state = atomic.commit, FieldFile.write_state

    def kill_if(condition):
        if condition:
            os.kill(os.getpid(), signal.SIGKILL)

    def sabotaged_commit(part, path):
        kill_if(path.name == "{name}" and comm.rank == 0)
        commit(part, path)

    def sabotaged_state(self, number, state):
        kill_if("{name}" == f"state {{number}}" and comm.rank == comm.size - 1)
        write_state(self, number, state)

    atomic.commit, FieldFile.write_state = sabotaged_commit, sabotaged_state

def command(words, comm):
    launch(comm)
    return cli._command(words, comm)

sys.exit(api.start(command))
"""
# In the order in which a run comes to them, and how many events are kept then: all (None) when fields are written.
MOMENTS = {"000001.h5": 1, "000003.h5": 3, "state 2": None, "result.h5": None, "result.json": None, "path.csv": None}


def test_a_run_that_is_killed_while_it_writes_goes_on(tmp_path):
    """Every run resumes the last, and is killed a little later."""
    case, out, script = tmp_path / "path.toml", tmp_path / "out", tmp_path / "sabotaged.py"
    case.write_text(PATH)
    for name, events in MOMENTS.items():
        script.write_text(SABOTAGED.format(name=name))
        job = mpirun(2, script, "run", case, "--out", out, "--resume", timeout=100)
        assert job.returncode not in (0, 2, 3) and "Traceback" not in job.stderr, job.stderr
        kept = len(list((out / "checkpoint").glob("[0-9]*.h5")))
        assert kept == events or (events is None and kept > 3)
        assert (out / "result.h5").exists() == (name in ("result.json", "path.csv"))
        assert (out / "result.json").exists() == (name == "path.csv")
        if name == "result.json":
            refused = command_line(0, "verify", out)
            assert refused.returncode == 2 and refused.stderr.startswith(f"error: cannot read {out / 'result.json'}")
    job = command_line(2, "run", case, "--out", out, "--resume", timeout=100)
    assert job.returncode == 0 and f"{kept} events are taken from the checkpoint" in job.stdout, job.stderr
    document = json.loads((out / "result.json").read_text())
    assert document["status"] == "done" and document["resumed"] == kept == len(document["path"])
    assert not list(out.glob("*.part")) and not (out / "checkpoint").exists() and not (out / "result.lock").exists()
