"""Which cells are cut across materials, and into how many pieces."""

from __future__ import annotations

import pytest
from support.cases import make_case

from feti_homog.homogenization.partition_policy import BY_COST, DEFAULT_POLICY, can_be_cut_across

WITHOUT_FIELDS = {"output": {"fields": False}}


@pytest.mark.parametrize(
    ("change", "may"),
    [
        ({}, True),
        ({"output": {}}, False),
        ({"output": {"fields": False, "sensitivities": True}}, False),
        ({"decomposition": {"cut": "bodies"}}, False),
        ({"decomposition": {"subdomains": 9}}, False),
        ({"decomposition": {"max_dofs": 900}}, False),
        ({"bodies": "plane"}, False),
        ({"fibre": {"young": 1e5, "poisson": 0.3}, "matrix": {"young": 1.0, "poisson": 0.3}}, False),
        ({"fibre": {"young": 9e3, "poisson": 0.3}, "matrix": {"young": 1.0, "poisson": 0.3}}, True),
        ({"order": 2, "matrix": {"young": 1.0, "poisson": 0.49}, "element": "mixed"}, False),
    ],
)
def test_only_cells_in_which_nothing_is_asked_of_bodies_are_cut_across_materials(change, may):
    assert can_be_cut_across(make_case(**WITHOUT_FIELDS | change)) == may


@pytest.mark.parametrize(
    ("dofs", "ranks", "pieces"),
    [(60_000, 1, 1), (60_000, 2, 8), (12_000, 2, 2), (12_000, 4, 4), (210_000, 1, 30), (500_000, 1, 0)],
)
def test_pieces_are_of_the_fastest_size(dofs, ranks, pieces):
    assert BY_COST.across_pieces(dofs, ranks) == pieces
    assert DEFAULT_POLICY.across_pieces(dofs, ranks) == 0
