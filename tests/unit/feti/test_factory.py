"""Making the parts of the solver."""

from __future__ import annotations

from feti_homog.feti.factory import CLASSES
from feti_homog.feti.solver_plan import BONDED, PRECONDITIONERS


def test_every_preconditioner_has_a_class():
    assert set(CLASSES) | {"auto"} == {*PRECONDITIONERS, BONDED}
