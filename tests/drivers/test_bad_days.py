"""Faults outside the case: Ctrl-C, outputs that cannot be written, a locale without the letters of a name."""

import json
import os
import signal
import subprocess
import sys

import pytest
from support.base_case import changed
from support.command_line import case_file, command_line, in_process
from support.hooks import WAIT, Hook, HookedJob
from support.hostile_inputs import of_mesh, write_grid
from support.jobs import PATIENCE, ROOT, environment
from support.sweep_files import BY_BODIES

# A rank waits where a mesher would keep it for long.
MESHING = "feti_homog.homogenization.tile_tearing:begin_mesh"


@pytest.fixture(autouse=True)
def attentive():
    """Programs that the test starts hear SIGINT, also where the suite itself is a background job, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_ctrl_c_is_one_line_and_130(tmp_path, command):
    path = case_file(tmp_path, '[sweep]\n"cell.order" = [1, 2]\n' if command == "sweep" else "")
    with HookedJob(0, [Hook(MESHING, WAIT)], command, path, "--out", tmp_path / "out") as job:
        assert job.reported() == "0 here"
        job.process.send_signal(signal.SIGINT)
        ended = job.ended()
    assert (ended.returncode, ended.stderr) == (130, "interrupted by SIGINT\n")
    assert not list(tmp_path.rglob("*lock"))


def test_the_order_to_end_is_one_line_of_all_ranks(tmp_path):
    """SIGTERM, which mpirun sends some seconds after Ctrl-C.  Rank 1, here the first, outlives rank 0."""
    out = tmp_path / "out"
    here = Hook("feti_homog.homogenization.tile_tearing:place_nodes", "report(os.getpid()); wait()", rank=None)
    last = Hook("feti_homog.system.runtime.standard_streams:time.sleep", "report('ends'); outlive(0)", rank=1)
    with HookedJob(2, [here, last], "run", case_file(tmp_path), "--out", out) as job:
        reports = [job.reported().split() for _ in range(4)]
        assert [line for line in sorted(reports) if not line[1].isdecimal()] == [["0", "here"], ["1", "here"]]
        pids = {rank: int(word) for rank, word in reports if word.isdecimal()}
        os.kill(pids["1"], signal.SIGTERM)
        assert job.reported() == "1 ends" and (out / "result.lock").exists()
        os.kill(pids["0"], signal.SIGTERM)
        ended = job.ended()
    assert ended.returncode == 143 and ended.stderr.count("interrupted by SIGTERM\n") == 1, ended.stderr
    assert "Traceback" not in ended.stderr and not list(out.glob("*lock"))


def test_a_refused_case_is_one_line_under_a_quiet_mpirun(tmp_path):
    """Open MPI 5 has no `-q`: its own lines follow."""
    version = subprocess.run(["mpirun", "--version"], capture_output=True, text=True, check=True).stdout
    quiet = [] if "Open MPI) 5" in version else ["-q"]
    words = ["mpirun", *quiet, "--oversubscribe", "-n", "2", sys.executable, "-m", "feti_homog", "check"]
    faulty = tmp_path / "faulty.toml"
    faulty.write_text(changed(("fibre_fraction = 0.4", "fibre_fraction = 1.4")))
    job = subprocess.run(
        [*words, faulty], cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert job.returncode == 2 and job.stdout == ""
    (line,) = [line for line in job.stderr.splitlines() if quiet or line.startswith("error")]
    assert line.startswith("error: [cell] fibre_fraction = 1.4: expected")


def run_into(stdout, *words):
    return subprocess.run(
        [sys.executable, "-m", "feti_homog", *map(str, words)],
        cwd=ROOT, env=environment(), stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=PATIENCE,
    )  # fmt: skip


def test_a_full_output_costs_no_results(tmp_path):
    with open("/dev/full", "w") as full:
        job = run_into(full, "run", case_file(tmp_path), "--out", tmp_path / "out")
        listing = run_into(full, "keys")
    assert job.returncode == 0 and json.loads((tmp_path / "out/result.json").read_text())["status"] == "done"
    assert job.stderr.count("standard output cannot be written: No space left on device") == 1
    assert (listing.returncode, len(listing.stderr.splitlines())) == (1, 1)


@pytest.mark.parametrize("words", [["run"], ["--help"]])
def test_a_reader_that_leaves_costs_no_results(tmp_path, words):
    out = tmp_path / "out"
    reader, writer = os.pipe()
    os.close(reader)
    job = run_into(writer, *words, *([case_file(tmp_path), "--out", out] if words == ["run"] else []))
    os.close(writer)
    assert (job.returncode, job.stderr) == (0, "")
    assert words != ["run"] or (out / "result.h5").exists()


def test_a_closed_output_costs_no_results(tmp_path):
    command = f'"{sys.executable}" -m feti_homog run {case_file(tmp_path)} --out {tmp_path / "out"} >&-'
    assert subprocess.run(["bash", "-c", command], cwd=ROOT, env=environment(), timeout=PATIENCE).returncode == 0
    assert (tmp_path / "out/result.json").exists()


def test_names_that_the_locale_cannot_write(tmp_path):
    path = tmp_path / "größe.toml"
    path.write_bytes(case_file(tmp_path).read_bytes())
    words = [sys.executable, "-m", "feti_homog", "run", path, "--out", tmp_path / "öut"]
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    job = subprocess.run(words, cwd=ROOT, env=environment() | locale, capture_output=True, timeout=PATIENCE)
    assert (job.returncode, job.stderr) == (0, b"")
    assert json.loads((tmp_path / "öut/result.json").read_text(encoding="utf-8"))["case"]["name"] == "größe"


def test_a_matrix_without_fibres_runs_on_two_ranks_without_a_word_of_cholmod(tmp_path):
    write_grid(tmp_path / "plain.msh", 4, 1.0)
    mesh = (tmp_path / "plain.msh").read_text().replace("1 2 2 2 2 ", "1 2 2 1 1 ").replace('2\n2 1 "m', '1\n2 1 "m')
    (tmp_path / "plain.msh").write_text(mesh.replace('2 2 "fibre"\n', ""))
    content = of_mesh("plain").replace("[material.fibre]\nyoung = 200.0\npoisson = 0.222\n", "")
    (tmp_path / "plain.toml").write_text(content + "[output]\npictures = false\n")
    job = command_line(2, "run", tmp_path / "plain.toml", "--out", tmp_path / "out", "--quiet")
    assert (job.returncode, job.stderr) == (0, "")


def test_a_failed_check_of_a_nearly_incompressible_phase_has_a_hint(tmp_path):
    path = case_file(tmp_path)
    path.write_text(path.read_text().replace("0.299", "0.49999999999").replace("= 0.15", "= 0.15\norder = 2"))
    job = in_process("run", path, "--out", tmp_path / "out")
    assert "warning: [material.matrix] poisson = 0.49999999999: so near to 0.5 that rounding may exceed" in job.stdout


def test_a_sweep_leaves_no_lock_files(tmp_path):
    path = case_file(tmp_path, '[output]\npictures = false\nfields = false\n[sweep]\n"cell.mesh_size" = [0.2, 0.25]\n')
    job = command_line(2, "sweep", path, "--out", tmp_path / "out")
    assert job.returncode == 0, job.stderr
    assert not list(tmp_path.rglob("*lock"))


def test_a_flag_does_not_swallow_the_case_file(tmp_path):
    job = command_line(1, "run", "-feti_view", case_file(tmp_path), "--out", tmp_path / "out")
    assert job.returncode == 0 and "FETI: 1 subdomain," in job.stdout


def test_flags_may_be_false(tmp_path):
    options = "[petsc]\nfeti_ksp_monitor = false\nfeti_view = true\n"
    path = case_file(tmp_path, f"[output]\npictures = false\n{options}{BY_BODIES}")
    job = command_line(1, "run", path, "--out", tmp_path / "out", "-feti_ksp_converged_reason", "no")
    assert job.returncode == 0, job.stderr
    assert "KSP Residual" not in job.stdout and "converged due" not in job.stdout and "FETI: 3" in job.stdout
