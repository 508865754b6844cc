"""The ratios of mesh errors that all ranks use."""

from types import SimpleNamespace
from typing import Any

import pytest

from feti_homog.homogenization.mesh_estimate import SAMPLED, factors


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("other", [True, False])
def test_ranks_use_one_ratio_where_bubbles_exist_on_some(own: bool, other: bool) -> None:
    comm = SimpleNamespace(allreduce=lambda value, op: value or other)
    cell: Any = SimpleNamespace(
        lattice=SimpleNamespace(order=1), summary=SimpleNamespace(across=True), comm=comm,
        subdomains=[SimpleNamespace(is_mixed=False), SimpleNamespace(is_mixed=own)],
    )  # fmt: skip
    assert factors(cell, 1) == SAMPLED[own or other]
