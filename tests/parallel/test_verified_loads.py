"""Results of mixed loads, in the plane and in space, obey every law on several ranks.

Those of one rank do in `tests/unit/verify/test_falsified_results.py`.
"""

from pathlib import Path
from typing import Any

import pytest
from support.ranks import PIECES, assert_certified
from support.verified_results import document

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]


def test_mixed_loads_obey_every_law(comm: Any, shared_path: Path) -> None:
    if comm.size == 1:
        pytest.skip("of one rank there")
    for kind in ("mixed", "cooled, thinned", "axial springs", "spatial contact"):
        run(Case.parse(document(kind) | {"decomposition": PIECES}), comm, out=shared_path / kind)
        assert_certified(comm, shared_path / kind)
