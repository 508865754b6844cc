"""How a job of the command line ends when something is wrong: exit codes, messages, no rank left waiting."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import pytest
from support.base_case import BASE
from support.command_line import case_file, command_line
from support.jobs import mpirun
from unit.cell.faulty_meshes import FAULTY_MESHES
from unit.config.faulty_cases import FAULTY_CASES

CASES = ("empty", "syntax", "unknown_key", "many")
MESH_CASE = 'geometry = "mesh"\nfile = "faulty.msh"'

# The command line with a fault in the dual operator of the last rank, at the application of a given number.
SABOTAGED = """
import os, signal, sys
from feti_homog import api, cli

def launch():
    from feti_homog.feti.operators.dual_operator import DualOperator
    from mpi4py import MPI
    comm, apply, count = MPI.COMM_WORLD, DualOperator.apply, 0

    def sabotaged(self, x):
        nonlocal count
        count += 1
        if comm.rank == comm.size - 1 and count == {application}:
            {fault}
        return apply(self, x)

    DualOperator.apply = sabotaged

def command(words, comm):
    launch()
    return cli._command(words, comm)

sys.exit(api.start(command))
"""


# The command line with a fault of the last rank while it fills its tiles of a large cell.
SABOTAGED_MESHING = """
import os, signal, sys
from feti_homog import api, cli

def command(words, comm):
    from feti_homog.homogenization import coarse_meshes
    fill = coarse_meshes.fill

    def sabotaged(tile):
        if comm.rank == comm.size - 1:
            {fault}
        return fill(tile)

    coarse_meshes.fill = sabotaged
    return cli._command(words, comm)

sys.exit(api.start(command))
"""
TILED_CELL = 'geometry = "random"\nfibres = 400\nmin_gap = 0.2\nfibre_fraction = 0.3\nmesh_size = 0.05'


def assert_refused(job, expected, out):
    assert job.returncode == 2, job.stderr
    lines = [line for line in job.stderr.splitlines() if line.startswith("error: ")]
    assert len(set(lines)) == len(lines)
    for words in expected:
        assert any(words in line for line in lines), job.stderr
    assert not out.exists() and not job.stdout


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_faulty_cases_end_with_2_and_write_nothing(tmp_path, name, ranks):
    content, expected = FAULTY_CASES[name]
    (tmp_path / "cell.toml").write_text(content)
    job = command_line(ranks, "run", tmp_path / "cell.toml", "--out", tmp_path / "results")
    assert_refused(job, expected, tmp_path / "results")


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", ["hanging", "not periodic, right", "inverted", "no matrix"])
def test_faulty_meshes_end_with_2_and_write_nothing(tmp_path, name, ranks):
    write, message = FAULTY_MESHES[name]
    write(tmp_path / "faulty.msh")
    path = case_file(tmp_path)
    words = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.15'
    path.write_text(path.read_text().replace(words, MESH_CASE))
    job = command_line(ranks, "run", path, "--out", tmp_path / "results", "--quiet")
    assert_refused(job, [message], tmp_path / "results")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["-feti_ksp_rtoll", "1e-3"], "-feti_ksp_rtoll"),
        (["-feti_foo"], "-feti_foo: unknown option"),
        (["-feti_ksp_rtol", "2.0"], "-feti_ksp_rtol 2.0: expected a number above 0 and below 1"),
        (["-feti_pc_typ", "none"], "-feti_pc_typ"),
        (["-feti_pc_type", "jacobi"], "-feti_pc_type jacobi: expected one of auto, none, lumped, dirichlet, influence"),
    ],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_mistyped_options_end_with_2(tmp_path, ranks, option, message):
    job = command_line(ranks, "run", case_file(tmp_path), "--out", tmp_path / "results", "--quiet", *option)
    assert_refused(job, [message], tmp_path / "results")


def test_mistyped_options_of_the_case_end_with_2(tmp_path):
    path = case_file(tmp_path, "[petsc]\nfeti_ksp_rtoll = 1e-3\n")
    job = command_line(2, "run", path, "--out", tmp_path / "results", "--quiet")
    assert_refused(job, ["feti_ksp_rtoll"], tmp_path / "results")


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_file_in_the_place_of_the_folder_is_left_alone(tmp_path, ranks):
    out = tmp_path / "results"
    out.write_text("mine")
    for folder in (out, out / "deeper"):
        job = command_line(ranks, "run", case_file(tmp_path), "--out", folder)
        assert job.returncode == 2 and job.stderr.count("is a file") == 1
    assert out.read_text() == "mine"


HOLDER = """
import sys, time
from pathlib import Path
from feti_homog.common.file_locks import TemporaryLock
TemporaryLock(Path(sys.argv[1])).acquire()
print("held", flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_folder_that_another_run_writes_to(tmp_path, ranks):
    out = tmp_path / "results"
    out.mkdir()
    other = subprocess.Popen([sys.executable, "-c", HOLDER, out / "result.lock"], stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline() == b"held\n"
        job = command_line(ranks, "run", case_file(tmp_path), "--out", out)
        assert job.returncode == 2 and job.stderr.count("error: ") == 1, job.stderr
        assert f"--out {out}: another run writes its results there: " in job.stderr
        assert f"process {other.pid}" in job.stderr
        assert [path.name for path in out.iterdir()] == ["result.lock"]
    finally:
        other.kill()
        other.wait()
    assert command_line(ranks, "run", case_file(tmp_path), "--out", out).returncode == 0
    assert not (out / "result.lock").exists()


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_convergence_ends_with_3_and_keeps_what_was_computed(tmp_path, ranks):
    out = tmp_path / "results"
    job = command_line(ranks, "run", case_file(tmp_path), "--out", out, "-feti_ksp_max_it", "2")
    assert job.returncode == 3
    assert job.stderr.count("error: E11: no convergence after 2 iterations") == 1
    document = json.loads((out / "result.json").read_text())
    assert document["status"] == "not converged"
    assert document["solver"]["iterations"] == [2, 2, 2]
    assert (out / "result.h5").exists()


def test_loose_tolerance(tmp_path):
    """It is told of, and what it makes wrong is marked."""
    out = tmp_path / "results"
    job = command_line(2, "run", case_file(tmp_path), "--out", out, "-feti_ksp_rtol", "0.3")
    document = json.loads((out / "result.json").read_text())
    assert job.stdout.count("warning: -feti_ksp_rtol 0.3 asks for less") == 1
    assert any("-feti_ksp_rtol 0.3" in warning for warning in document["warnings"])
    assert max(document["checks"].values()) > document["check_tolerance"] == 1e-4
    assert job.returncode == 3 and document["status"] == "not converged"


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("application", [1, 3], ids=["outside PETSc", "inside PETSc's callback"])
def test_a_rank_that_raises_ends_the_job_with_its_traceback(tmp_path, ranks, application):
    job = sabotaged(tmp_path, ranks, application, "raise ArithmeticError('lost my way')")
    assert job.returncode not in (0, 2, 3)
    assert "Traceback" in job.stderr and "ArithmeticError: lost my way" in job.stderr
    assert f"rank {ranks - 1} of {ranks}:" in job.stderr


def test_a_rank_that_is_killed_ends_the_job(tmp_path):
    assert sabotaged(tmp_path, 2, 3, "os.kill(os.getpid(), signal.SIGKILL)").returncode != 0


@pytest.mark.parametrize(
    ("fault", "code", "words"),
    [
        ("raise ArithmeticError('lost my tile')", 1, "ArithmeticError: lost my tile"),
        ("from feti_homog.errors import MeshError; raise MeshError('[cell] this tile has no mesh')", 2, "no mesh"),
        ("os.kill(os.getpid(), signal.SIGKILL)", None, ""),
    ],
    ids=["defect", "unfilled", "killed"],
)
def test_a_rank_that_fails_while_meshing_ends_the_job(tmp_path, fault, code, words):
    script, out = tmp_path / "sabotaged.py", tmp_path / "results"
    script.write_text(SABOTAGED_MESHING.format(fault=fault))
    start = time.monotonic()
    case = tmp_path / "tiled.toml"
    case.write_text(f"[cell]\n{TILED_CELL}\n\n" + BASE[BASE.index("[material.matrix]") :])
    job = mpirun(2, script, "run", case, "--out", out, timeout=60.0)
    assert time.monotonic() - start < 40.0
    assert job.returncode == code if code else job.returncode != 0
    assert words in job.stderr and ("Traceback" in job.stderr) == (code == 1)
    assert not (out / "result.json").exists()


def sabotaged(folder, ranks, application, fault):
    """The job, which must end soon."""
    script = folder / "sabotaged.py"
    script.write_text(SABOTAGED.format(application=application, fault=fault))
    start = time.monotonic()
    words = ["run", case_file(folder), "--out", folder / "results", "-feti_dual_operator", "implicit"]
    job = mpirun(ranks, script, *words, timeout=30.0)
    assert time.monotonic() - start < 20.0
    return job
