"""Cells that ranks share, and assertions that all ranks agree on."""

from typing import Any

# Cuts small cells such that each of two ranks owns interface nodes; uncut, the matrix alone is on rank 0.
PIECES = {"subdomains": 8}


def parallel_assert(comm: Any, condition: bool, message: str = "") -> None:
    """Fails on every rank if the condition is false on any. Collective."""
    failing = [rank for rank, holds in enumerate(comm.allgather(bool(condition))) if not holds]
    assert not failing, f"{message} (on ranks {failing})"
