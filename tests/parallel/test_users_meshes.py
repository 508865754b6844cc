"""Meshes of users, whose fibres are not round, from the file to results that obey every law."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.ranks import parallel_assert
from support.users_meshes import polar_cell
from support.verified_results import FIBRE, MATRIX

from feti_homog import Case, run
from feti_homog.verification.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


@pytest.mark.parametrize("order", [1, 2])
def test_debonded_ellipse_obeys_every_law(comm: Any, shared_path: Path, order: int) -> None:
    """A mesh of second order, with elements of either order."""
    mesh = shared_path / "ellipse.msh"
    if comm.rank == 0:
        polar_cell((0.5, 0.5), 0.2, mesh, stretch=1.5, order=2, size=0.15, turn=0.3)
    comm.barrier()
    document = {
        "cell": {"geometry": "mesh", "file": str(mesh), "order": order, "refine": 1},
        "material": {"matrix": MATRIX, "fibre": FIBRE},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "interface": {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 110.0}]},
        "output": {"pictures": False},
    }
    run(Case.parse(document), comm, out=shared_path / "out")
    certificate = verify(shared_path / "out") if comm.rank == 0 else None
    parallel_assert(comm, certificate is None or certificate.holds, certificate and certificate.text)
