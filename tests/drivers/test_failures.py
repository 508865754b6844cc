"""Failures of jobs of the command line: exit codes, messages, no rank left waiting."""

import json
import os
import signal
import subprocess
import sys

import pytest
from support.base_case import BASE
from support.command_line import case_file, command_line, in_process
from support.hooks import KILL, NO_MEMORY, Hook, HookedJob, hooked
from support.small_path import PATH

PIPES = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}

IMPLICIT = ("-feti_dual_operator", "implicit")
CUT = "[decomposition]\nsubdomains = 4\n[petsc]\nfeti_pc_type = 'influence'\n"
TILED_CELL = 'geometry = "random"\nfibres = 400\nmin_gap = 0.2\nfibre_fraction = 0.3\nmesh_size = 0.05'


HOLDER = """
import sys
from pathlib import Path
from feti_homog.system.runtime.file_locks import Lock
Lock(Path(sys.argv[1])).acquire()
print("held", flush=True)
sys.stdin.read()
"""


def test_a_folder_that_another_run_writes_to(tmp_path):
    out = tmp_path / "results"
    out.mkdir()
    other = subprocess.Popen([sys.executable, "-c", HOLDER, out / "result.lock"], **PIPES)
    try:
        assert other.stdout.readline() == b"held\n"
        job = command_line(2, "run", case_file(tmp_path), "--out", out)
        assert job.returncode == 2 and job.stderr.count("error: ") == 1, job.stderr
        assert f"--out {out}: another run writes its results there: " in job.stderr
        assert f"process {other.pid}" in job.stderr
        assert [path.name for path in out.iterdir()] == ["result.lock"]
    finally:
        other.communicate()
    assert in_process("run", case_file(tmp_path), "--out", out).returncode == 0
    assert not (out / "result.lock").exists()


def test_no_convergence_ends_with_3_and_keeps_what_was_computed(tmp_path):
    out = tmp_path / "results"
    case = case_file(tmp_path, '[output]\npictures = false\n[decomposition]\ncut = "bodies"\n')
    job = command_line(2, "run", case, "--out", out, "-feti_ksp_max_it", "2")
    assert job.returncode == 3
    assert job.stderr.count("error: E11: no convergence after 2 iterations") == 1
    assert job.stderr.count("; raise -feti_ksp_max_it\n") == 1
    document = json.loads((out / "result.json").read_text())
    assert document["status"] == "not converged"
    assert document["solver"]["iterations"] == [2, 2, 2]
    assert (out / "result.h5").exists()


def test_loose_tolerance(tmp_path):
    """A loose tolerance is reported, and the checks that it breaks are marked."""
    out = tmp_path / "results"
    job = command_line(2, "run", case_file(tmp_path), "--out", out, "-feti_ksp_rtol", "0.3", *IMPLICIT)
    document = json.loads((out / "result.json").read_text())
    assert job.stdout.count("warning: -feti_ksp_rtol 0.3 asks for less") == 1
    assert job.stdout.count("Warning     -feti_ksp_rtol 0.3 asks for less") == 1  # again in the summary at the end
    assert any("-feti_ksp_rtol 0.3" in warning for warning in document["warnings"])
    assert max(document["checks"].values()) > document["check_tolerance"] == 1e-4
    assert job.returncode == 3 and document["status"] == "not converged"


DUAL_OPERATOR = "feti_homog.feti.operators.interface_operators:DualOperator.apply"


@pytest.mark.parametrize(("ranks", "call"), [(1, 1), (3, 1), (3, 3)], ids=["alone", "outside PETSc", "in its callback"])
def test_a_rank_that_raises_ends_the_job_with_its_traceback(tmp_path, ranks, call):
    fault = Hook(DUAL_OPERATOR, "raise ArithmeticError('lost my way')", rank=ranks - 1, call=call)
    job = hooked(ranks, [fault], "run", case_file(tmp_path), "--out", tmp_path / "results", *IMPLICIT)
    assert job.returncode not in (0, 2, 3)
    assert "Traceback" in job.stderr and "ArithmeticError: lost my way" in job.stderr
    assert f"rank {ranks - 1} of {ranks}:" in job.stderr


@pytest.mark.parametrize("way", ["it combines", "it waits"])
def test_a_rank_that_is_killed_within_a_collective_call_ends_the_job(tmp_path, way):
    """No rank is left when the job has ended, whether they wait for the lost one or it waited for them."""
    of_all = Hook(DUAL_OPERATOR, f"comm.allreduce(0, op=lambda *_: {KILL})", rank=None, call=3)
    alone = Hook(DUAL_OPERATOR, "report(str(os.getpid())); comm.barrier()", rank=1, call=3)
    words = ("run", case_file(tmp_path), "--out", tmp_path / "results", *IMPLICIT)
    with HookedJob(3, [of_all if way == "it combines" else alone], *words) as job:
        if way == "it waits":
            os.kill(int(job.reported().split()[1]), signal.SIGKILL)
        assert job.ended().returncode not in (0, 2, 3)
    assert not (tmp_path / "results" / "result.json").exists()


# Where one of two ranks finds no memory: the rank, and the function that it begins then, in the order of a run.
WITHOUT_MEMORY = {
    "assembly": (1, "feti.decomposition.subdomain:Subdomain.build"),
    "factorization": (1, "feti.operators.interface_operators:_factor"),
    "Schur complement": (1, "feti.linalg.dense_matrices:schur_complement"),
    "coarse space": (1, "feti.coarse.natural:assemble_owned_rows"),
    "field file": (1, "results.field_file:_write_rows"),
    "contact": (1, "interface.contact.contact_problem:kkt_errors"),
    "influence columns": (1, "feti.exact.reference_cell:ReferenceCell.columns"),
    "checkpoint": (0, "results.checkpoints:Checkpoint.write"),
    "table": (0, "results.result_json:write_csv"),
    "picture": (1, "report.plots.figures:draw"),
}


@pytest.mark.parametrize("name", WITHOUT_MEMORY)
def test_a_rank_without_memory_ends_the_job(tmp_path, name):
    """All ranks are gone when `hooked` returns."""
    rank, place = WITHOUT_MEMORY[name]
    case, out = tmp_path / "path.toml", tmp_path / "out"
    case.write_text(PATH.replace("pictures = false", "").replace("[path]\n", "[path]\nmax_events = 2\n") + CUT)
    job = hooked(2, [Hook(f"feti_homog.{place}", NO_MEMORY, rank=rank)], "run", case, "--out", out)
    assert job.returncode == 1 and f"rank {rank} of 2 has no memory left: none left" in job.stderr, job.stderr
    assert "Traceback" not in job.stderr
    assert (out / "result.json").exists() == (name in ("table", "picture"))


@pytest.mark.parametrize(
    ("fault", "code", "words"),
    [
        (NO_MEMORY, 1, "error: rank 1 of 2 has no memory left: none left"),
        ("from feti_homog.errors import MeshError; raise MeshError('[cell] this tile has no mesh')", 2, "no mesh"),
        (KILL, None, ""),
    ],
    ids=["no memory", "unfilled", "killed"],
)
def test_a_rank_that_fails_while_meshing_ends_the_job(tmp_path, fault, code, words):
    case, out = tmp_path / "tiled.toml", tmp_path / "results"
    case.write_text(f"[cell]\n{TILED_CELL}\n\n" + BASE[BASE.index("[material.matrix]") :])
    hook = Hook("feti_homog.mesh.tiles.tile_filling:fill", fault, rank=1)
    job = hooked(2, [hook], "run", case, "--out", out)
    assert job.returncode == code if code else job.returncode != 0
    assert words in job.stderr and "Traceback" not in job.stderr
    assert not (out / "result.json").exists()
