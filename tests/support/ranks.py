"""Cells that ranks share, and assertions that all ranks agree on."""

from pathlib import Path
from typing import Any

from feti_homog.verify.certificate import verify

# Cuts small cells such that each of two ranks owns interface nodes; uncut, the matrix alone is on rank 0.
PIECES = {"subdomains": 8}


def parallel_assert(comm: Any, condition: bool, message: str = "") -> None:
    """Fails on every rank if the condition is false on any. Collective."""
    failing = [rank for rank, holds in enumerate(comm.allgather(bool(condition))) if not holds]
    assert not failing, f"{message} (on ranks {failing})"


def write_once(comm: Any, mesh: Any, path: Path) -> None:
    """Write a mesh on rank 0, before any rank reads it. Collective."""
    if comm.rank == 0:
        mesh.write(path)
    comm.barrier()


def told_once(comm: Any, capsys: Any, *words: str) -> str:
    """Check that rank 0 alone has printed an error, in one line with these words; return stdout. Collective."""
    output, errors = capsys.readouterr()
    lines = errors.splitlines()
    good = len(lines) == 1 and lines[0].startswith("error: ") and all(each in lines[0] for each in words)
    parallel_assert(comm, good if comm.rank == 0 else not lines, errors)
    return str(output)


def assert_certified(comm: Any, folder: Path) -> None:
    """Check that the result in a folder obeys every law of `feti-homog verify`. Collective."""
    certificate = verify(folder) if comm.rank == 0 else None
    parallel_assert(comm, certificate is None or certificate.holds, certificate and certificate.text)
