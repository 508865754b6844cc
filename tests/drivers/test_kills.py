"""kill -9 of one rank while files are written: the others end, what is there is no result yet, and --resume goes on."""

import json
import re

from support import events
from support.command_line import command_line, in_process
from support.hooks import KILL, Hook, hooked
from support.small_path import PATH

WRITE = "feti_homog.results.checkpoints:Checkpoint.write"
COMMIT = "feti_homog.results.atomic:commit"
WRITE_STATE = "feti_homog.results.field_file:FieldFile.write_state"
# In the order in which a run comes to them, and how many events are kept then: all (None) when fields are written.
MOMENTS = {"event 3": 3, "state 2": None, "result.h5": None, "result.json": None, "path.csv": None}


def test_a_run_that_is_killed_while_it_writes_goes_on(tmp_path):
    """Every run resumes the last, and is killed a little later."""
    case, out = tmp_path / "path.toml", tmp_path / "out"
    case.write_text(PATH)
    for name, count in MOMENTS.items():
        hook = Hook(COMMIT, KILL, when=f"args[1].name == '{name}'")
        if name.startswith("event"):
            hook = Hook(WRITE, KILL, when=f"args[1] == {name.split()[1]}")
        if name.startswith("state"):
            hook = Hook(WRITE_STATE, KILL, rank=1, when=f"args[1] == {name.split()[1]}")
        job = hooked(2, [hook], "run", case, "--out", out, "--resume")
        assert job.returncode not in (0, 2, 3) and "Traceback" not in job.stderr, job.stderr
        kept = events.count(out)
        assert kept == count or (count is None and kept > 3)
        assert (out / "result.h5").exists() == (name in ("result.json", "path.csv"))
        assert (out / "result.json").exists() == (name == "path.csv")
        if name == "result.json":
            start = f"error: {out}: the run is unfinished, "
            way = f"; go on by `feti-homog run CASE --out {out} --resume`\n"
            line = rf"{re.escape(start)}{kept} points up to load [\d.]+{re.escape(way)}"
            for refused in (in_process(command, out) for command in ("verify", "fields")):
                assert refused.returncode == 2 and re.fullmatch(line, refused.stderr)
    job = command_line(2, "run", case, "--out", out, "--resume")
    assert job.returncode == 0 and f"{kept} events are taken from the checkpoint" in job.stdout, job.stderr
    document = json.loads((out / "result.json").read_text())
    assert document["status"] == "done" and document["resumed"] == kept == len(document["path"])
    assert not list(out.glob("*.part")) and not (out / "checkpoint").exists() and not (out / "result.lock").exists()
