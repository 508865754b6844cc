"""All ranks raise an error that one rank finds while it makes its part of the solver."""

import pytest
from support.torn_cells import tear

from feti_homog.errors import CaseError, MeshError
from feti_homog.feti.coarse import geneo
from feti_homog.feti.operators import interface_operators

pytestmark = pytest.mark.parallel

CUT = {"petsc": {"feti_coarse_space": "adaptive"}, "decomposition": {"subdomains": 6}}


@pytest.mark.parametrize(
    ("module", "name", "error"),
    [(interface_operators, "_factor", CaseError), (geneo, "eigenproblem", MeshError)],
    ids=["operators", "eigenproblems"],
)
def test_all_ranks_raise_it(comm, monkeypatch, module, name, error):
    def refuse(*_):
        raise error("refused")

    if comm.rank == comm.size - 1:
        monkeypatch.setattr(module, name, refuse)
    with pytest.raises(error, match="refused"):
        tear(comm, **CUT)
