"""The text that a command makes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from feti_homog.runtime import standard_streams

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def print_product(comm: Intracomm, text: str) -> None:
    """Print the text of rank 0, which is all that a command makes.  Collective."""
    from feti_homog.parallel.mpi_errors import on_root_only

    on_root_only(comm, standard_streams.print_product, text)
