"""Shared entities and nodes where bonds may break, against a count triangle by triangle on the whole cell."""

import numpy as np
import pytest
from support.generated_meshes import generate

from feti_homog.case.cell_section import Cell
from feti_homog.feti.decomposition.partition import decompose, pieces_for_size
from feti_homog.feti.decomposition.shared_entities import share_entities
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, pinned_classes

pytestmark = [pytest.mark.parallel, pytest.mark.quick]
PAIRS = np.array([[-1, 0], [0, -1]])


@pytest.fixture(scope="module")
def torus():
    keys = {"fibres": 9, "fibre_fraction": 0.5, "min_gap": 0.06, "seed": 1, "mesh_size": 0.06}
    return Torus.of(generate(Cell(geometry="random", radius_spread=0.0, **keys)))


def shared_by_ranks(torus, comm, intervals=2):
    """Return the decomposition into pieces of about 20 triangles, and what this rank's share."""
    pieces = pieces_for_size(np.bincount(torus.constituent), 1, 20)
    cut = decompose(torus, torus.constituent, pieces, comm.size)
    table = SubdomainTable.of(torus, cut.subdomain, cut.rank)
    own = list(cut_for_ranks(torus, cut.subdomain, table, comm.size, pinned_classes(torus)))[comm.rank]
    lattice = ReferenceLattice.of({1: 0, 2: 1}[intervals], 1)
    return cut, share_entities(comm, own, table, PAIRS, lattice)


def test_they_are_those_of_several_subdomains(torus, comm):
    cut, share = shared_by_ranks(torus, comm)
    expected = {}
    for kind, keys in ((False, torus.node_class[torus.mesh.triangles]), (True, torus.triangle_torus_edges)):
        for key, owner in zip(keys.tolist(), cut.subdomain.tolist(), strict=True):
            for k in key:
                expected.setdefault((kind, k), set()).add(owner)
    expected = {key: owners for key, owners in expected.items() if len(owners) > 1}
    expected.pop((False, int(pinned_classes(torus)[0])), None)
    owners = [set(own.tolist()) for own in np.split(share.sharer, share.pointer[1:-1])]
    found = dict(zip(zip(share.is_edge.tolist(), share.key.tolist(), strict=True), owners, strict=True))
    assert found == {key: own for key, own in expected.items() if any(cut.rank[k] == comm.rank for k in own)}


def test_each_constraint_belongs_to_one_rank_and_has_one_number(torus, comm):
    _, share = shared_by_ranks(torus, comm)
    owned = comm.allgather(share.owned)
    assert [first for first, _ in owned] == [0, *(last for _, last in owned[:-1])]
    assert owned[-1][1] == share.constraints
    mine = (share.first >= share.owned[0]) & (share.first < share.owned[1])
    assert np.diff(share.owned)[0] == (share.nodes * (share.copies - 1))[mine].sum()
    received = [
        {(int(k), bool(e)): int(n) for k, e, n in zip(s.key, s.is_edge, s.first, strict=True)}
        for s in comm.allgather(share)
    ]
    for others in received:
        for entity, number in received[comm.rank].items():
            assert others.get(entity, number) == number


def test_coarse_cells_have_vertices_alone(torus, comm):
    _, fine = shared_by_ranks(torus, comm)
    _, coarse = shared_by_ranks(torus, comm, intervals=1)
    assert not coarse.is_edge.any() and set(coarse.key) == set(fine.key[~fine.is_edge])


def test_normals_are_radii_of_the_fibres(torus, comm):
    """Length of dx / ds: of an edge its circle's radius times the angle that it turns by, with fine nodes or not.

    Of a vertex the mean of both sides of elements.
    """
    for intervals in (1, 2):
        _, share = shared_by_ranks(torus, comm, intervals)
        at = share.fibre >= 0
        radius = torus.mesh.ellipses.circles[0, 2]
        length = np.linalg.norm(share.normal, axis=-1)
        edges = at & share.is_edge
        assert np.allclose(length[edges], radius * share.turn[edges, None], rtol=1e-12)
        place = {int(c): p for c, p in zip(torus.node_class, torus.mesh.points, strict=True)}
        for k in np.flatnonzero(at & ~share.is_edge).tolist():
            offsets = place[int(share.key[k])] - torus.mesh.ellipses.circles[:, :2]
            offsets -= np.round(offsets)
            near = offsets[np.argmin(np.abs(np.hypot(*offsets.T) - radius))]
            assert share.normal[k, 0] @ near == pytest.approx(radius * length[k, 0], rel=0.02)


def test_nothing_can_break_inside_a_body(torus, comm):
    _, share = shared_by_ranks(torus, comm)
    inside = np.array([len(set(own)) == 1 for own in np.split(share.body, share.pointer[1:-1])])
    assert np.all(share.fibre[inside] == -1) and np.all(share.pair[inside] == -1)
    assert np.any(share.fibre >= 0) and not share.precracked.any()
