"""Ends of jobs in which ranks raise, together or alone."""

import re

import pytest

PROGRAM = """
import sys
from mpi4py import MPI
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.system.parallel.mpi_errors import agree_after, run_main
comm = MPI.COMM_WORLD

def stuck():
    raise ConvergenceError("stuck")

def main():
    {body}
    comm.barrier()
    return 0

sys.exit(run_main(comm, main))
"""


def run(mpirun, ranks, body):
    return mpirun(ranks, "-c", PROGRAM.format(body=body))


def test_a_job_without_faults_ends_with_zero(mpirun):
    assert run(mpirun, 2, "pass").returncode == 0


@pytest.mark.slow
def test_faults_of_all_ranks_are_reported_once(mpirun):
    job = run(mpirun, 3, "raise CaseError('[cell] one', '[cell] two')")
    assert job.returncode == 2
    assert job.stderr.count("error: [cell] one\n") == job.stderr.count("error: [cell] two\n") == 1
    assert "Traceback" not in job.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "words", "code"),
    [
        ("if comm.rank == comm.size - 1: raise KeyError('lost')", "rank 1 of 2:.*KeyError: 'lost'", 1),
        ("if comm.rank == comm.size - 1: raise ConvergenceError('stuck')", "error: stuck", 3),
        # Within what communicates: after it, which all hear, and before it, which the others would wait for.
        ("agree_after(comm, lambda: comm.barrier() or 1 // comm.rank)", "ZeroDivisionError", 1),
        ("agree_after(comm, lambda: 1 // comm.rank and comm.barrier())", "ZeroDivisionError", 1),
        ("agree_after(comm, lambda: comm.rank or stuck() and comm.barrier())", "error: stuck", 3),
        ("agree_after(comm, lambda: comm.barrier() or comm.rank or stuck())", "error: stuck", 3),
    ],
)
def test_a_rank_that_raises_alone_ends_the_job(mpirun, body, words, code):
    job = run(mpirun, 2, body)
    assert job.returncode == code
    assert re.search(words, job.stderr, re.DOTALL)
