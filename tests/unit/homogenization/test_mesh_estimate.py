"""The mesh estimate: known tractions at shared vertices, and ratios of errors that all ranks use."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from feti_homog.homogenization import mesh_estimate
from feti_homog.homogenization.mesh_estimate import SAMPLED, factors


def group(points, sides, first):
    """Return a body: one quadratic triangle, its `sides` on an arc, and its first force row `first`."""
    nodes = np.array([[0, 3, 1], [1, 4, 2]])[:sides]
    places = np.concatenate([points, (points + np.roll(points, -1, axis=0)) / 2])
    stress = SimpleNamespace(
        node_class=np.arange(6), triangles=np.arange(3)[None], problem=SimpleNamespace(components=2)
    )
    on_arc = SimpleNamespace(
        element=np.zeros(sides, int), nodes=nodes, points=places[nodes], at_void=np.zeros(sides, bool)
    )
    return mesh_estimate.Group(stress, on_arc, first + 2 * np.arange(3))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_piece_that_meets_an_arc_in_a_vertex_has_its_traction(monkeypatch, unit):
    """Two pieces have a side each beside the vertex, a third has none, in any unit of length."""
    corners = unit * np.array([[0.0, 0.0], [1.5, 0.5], [1.0, 2.0]])
    groups = [group(corners, 1, 0), group(corners[[1, 2, 0]], 1, 6), group(corners[[1, 0, 2]], 0, 12)]
    classes = [np.array([1]), np.array([0]), np.array([0])]
    shared = SimpleNamespace(meshes=[0, 1, 2], classes=classes, sum=lambda parts: [sum(parts)] * 3)
    monkeypatch.setattr(mesh_estimate, "_forces", lambda *_: (np.ones((18, 1)), np.full(18, unit)))
    known = mesh_estimate.boundary_tractions(None, [], groups, shared, False)
    assert sorted(known) == [0, 1, 2]
    for name in ("normal", "traction"):
        assert np.isfinite(getattr(known[0], name)).all()
        assert getattr(known[2], name) == pytest.approx(getattr(known[0], name))


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("other", [True, False])
def test_ranks_use_one_ratio_where_bubbles_exist_on_some(own: bool, other: bool) -> None:
    comm = SimpleNamespace(allreduce=lambda value, op: value or other)
    cell: Any = SimpleNamespace(
        lattice=SimpleNamespace(order=1), summary=SimpleNamespace(across=True), comm=comm,
        subdomains=[SimpleNamespace(is_mixed=False), SimpleNamespace(is_mixed=own)],
    )  # fmt: skip
    assert factors(cell, 1) == SAMPLED[own or other]
