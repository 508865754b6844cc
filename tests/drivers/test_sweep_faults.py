"""`feti-homog sweep` and `collect` where files are damaged, the disk is full or the folder not ours."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from support.command_line import command_line, in_process
from support.jobs import PATIENCE, ROOT, RUN_VARIABLES, mpirun
from support.sweep_files import rows, sweep_file
from support.sweep_runs import TWO, collected, results, swept

LIMITED = """
import resource, sys
from mpi4py import MPI
from feti_homog import cli
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
sys.exit(cli.main(sys.argv[1:]))
"""


def test_corrupt_results_are_computed_again(tmp_path):
    """Try a file that is cut, one of random bytes, and one of another case."""
    out, path = tmp_path / "out", sweep_file(tmp_path, "cell.fibre_fraction = [0.2, 0.25, 0.3, 0.35]\n")
    swept(out, path)
    file = [out / f"case-{number:04}/result.json" for number in range(1, 5)]
    damaged = {file[1]: file[1].read_bytes()[:500], file[2]: os.urandom(500), file[3]: file[0].read_bytes()}
    for result, content in damaged.items():
        result.write_bytes(content)
    job = collected(out)
    assert "1 done, 3 damaged" in job.stdout
    assert [row["status"] for row in rows(out)] == ["done", "damaged", "damaged", "damaged"]
    again = swept(out, path)
    for result, content in damaged.items():
        assert f"{result.parent.name}/result.json is" in job.stdout
        assert f"{result.parent.name}: " in again.stdout
        assert result.with_name("result.json.damaged").read_bytes() == content
    assert again.stdout.count("set aside, the case is computed again") == 3
    assert "4 done" in collected(out).stdout


def test_a_case_whose_fields_are_cut_is_computed_again(tmp_path):
    """A case whose fields were removed stays: they take most of the room."""
    out, path = tmp_path / "out", sweep_file(tmp_path, TWO)
    path.write_text(path.read_text().replace("fields = false", "fields = true"))
    swept(out, path)
    fields = [out / f"case-000{number}/result.h5" for number in (1, 2)]
    size = fields[0].stat().st_size
    os.truncate(fields[0], size // 2)
    fields[1].unlink()
    assert "1 damaged, 1 done" in collected(out).stdout
    assert "case-0001: " in swept(out, path).stdout
    assert "2 done" in collected(out).stdout
    assert fields[0].stat().st_size == size and not fields[1].exists()


def test_a_damaged_list_of_cases_is_reported(tmp_path):
    out, path = tmp_path / "out", sweep_file(tmp_path, TWO)
    swept(out, path)
    (out / "sweep.json").write_text('{"cases": [')
    for words in (["sweep", path, "--out", out], ["collect", out]):
        job = in_process(*words)
        assert job.returncode == 2 and "sweep.json is damaged" in job.stderr and "Traceback" not in job.stderr
    before = results(out)
    (out / "sweep.json").unlink()
    job = in_process("sweep", sweep_file(tmp_path, TWO.replace("0.2", "0.21")), "--out", out)
    assert job.returncode == 2 and "would replace it" in job.stderr
    assert "2 of 2 cases done" in swept(out, sweep_file(tmp_path, TWO)).stdout
    assert len(before) == 2 and results(out) == before


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        ('"petsc.feti_ksp_rtol" = [1e-3, 2.0]', "case-0002: -feti_ksp_rtol 2.0: expected a number above 0 and below 1"),
        ('"cell.order" = [1, 2]\n[petsc]\nfeti_ksp_rtoll = 1e-3', "case-0001, case-0002: -feti_ksp_rtoll: no solver"),
    ],
)
def test_faulty_options_are_reported_before_anything_is_written(tmp_path, lines, fault):
    words = "sweep", sweep_file(tmp_path, f"{lines}\n"), "--out", (out := tmp_path / "out")
    for job in (command_line(2, *words), in_process(*words, "--index", "1")):
        assert job.returncode == 2 and job.stderr.startswith(f"error: {fault}") and not out.exists()


@pytest.mark.parametrize("limit", [1500, 200])
def test_a_full_disk_is_reported_and_the_sweep_goes_on_later(tmp_path, limit):
    """No file may be longer than the limit: below 1500 bytes no result can be written, below 200 not even the list."""
    out, path, script = tmp_path / "out", sweep_file(tmp_path, TWO), tmp_path / "limited.py"
    script.write_text(LIMITED.format(limit=limit))
    job = mpirun(0, script, "sweep", path, "--out", out)
    assert job.returncode == 1 and "Traceback" not in job.stderr, job.stderr
    assert "cannot write" in job.stderr and "File too large" in job.stderr
    assert not results(out) and not list(out.rglob("*.part"))
    swept(out, path)
    assert len(results(out)) == 2


def test_a_full_disk_while_collecting_leaves_the_old_table(tmp_path):
    out, script = tmp_path / "out", tmp_path / "limited.py"
    swept(out, sweep_file(tmp_path, TWO))
    collected(out)
    before = (out / "cases.csv").read_bytes()
    script.write_text(LIMITED.format(limit=300))
    job = mpirun(0, script, "collect", out)
    assert job.returncode == 1 and "cannot write" in job.stderr and "Traceback" not in job.stderr
    assert (out / "cases.csv").read_bytes() == before


def test_an_unwritable_folder_is_reported(tmp_path):
    """Root, who may write everywhere, does without that right: as another user it might not reach this file."""
    folder = Path(tempfile.mkdtemp())
    try:
        path, program = sweep_file(folder, TWO), ["-m", "feti_homog", "sweep"]
        folder.chmod(0o555)
        user = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
        words = [*user, sys.executable, *program, path, "--out", folder / "out"]
        environment = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "MPLCONFIGDIR": "/tmp"} | RUN_VARIABLES
        job = subprocess.run(
            list(map(str, words)), cwd=ROOT, env=environment, text=True, capture_output=True, timeout=PATIENCE
        )
        assert job.returncode == 2, job.stderr
        assert f"--out {folder / 'out'}: expected a folder that can be written to" in job.stderr
        assert not (folder / "out").exists()
    finally:
        folder.chmod(0o755)
        shutil.rmtree(folder)
