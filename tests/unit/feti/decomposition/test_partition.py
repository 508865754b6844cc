"""Pieces and ranks: connected, balanced, and neighbours together."""

import numpy as np
import pytest
from support.generated_meshes import generate

from feti_homog.case.cell_section import Cell
from feti_homog.feti.decomposition.partition import blocks, decompose, halves, pieces_for_count, pieces_for_size
from feti_homog.mesh.fill.pixel_mesher import read_cell
from feti_homog.mesh.periodic_topology import Torus, components, edge_pairs
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, pinned_classes


def torus_of(fibres, seed, mesh_size):
    """Return a random cell of 60 %."""
    cell = Cell(
        geometry="random",
        fibres=fibres,
        fibre_fraction=0.6,
        min_gap=0.06,
        seed=seed,
        radius_spread=0.0,
        mesh_size=mesh_size,
    )
    return Torus.of(generate(cell))


@pytest.fixture(scope="module")
def torus():
    return torus_of(16, 1, 0.03)


def fine(torus, n_ranks, size=20, **options):
    """Return the decomposition into pieces of about `size` triangles."""
    load = np.bincount(torus.constituent)
    return decompose(torus, torus.constituent, pieces_for_size(load, 1, size), n_ranks, **options)


def test_pieces_are_connected_and_within_one_body(torus):
    subdomain = fine(torus, 2).subdomain
    left, right = edge_pairs(torus.triangle_torus_edges)
    inside = subdomain[left] == subdomain[right]
    parts = components(len(subdomain), left[inside], right[inside])
    assert parts.max() == subdomain.max()
    bodies = np.unique(np.stack([subdomain, torus.constituent]), axis=1)
    assert bodies.shape[1] == subdomain.max() + 1


def test_halves_are_connected_even_and_shorter_around_than_those_of_metis(torus):
    left, right, _ = torus.sides
    found, metis = halves(torus), decompose(torus, np.zeros(len(torus.constituent), np.int64), np.array([2]), 2)
    inside = found.subdomain[left] == found.subdomain[right]
    assert components(len(found.subdomain), left[inside], right[inside]).max() == 1
    assert abs(found.subdomain.mean() - 0.5) < 0.03
    assert (~inside).sum() < (metis.subdomain[left] != metis.subdomain[right]).sum()


def test_blocks_are_even_rectangles_of_whole_pixels(tmp_path):
    image = np.zeros((30, 47), np.uint8)
    image[5:9, 7:20] = 1
    np.save(tmp_path / "image.npy", image)
    labels = {"0": "matrix", "1": "fibre"}
    mesh = read_cell(Cell(geometry="pixels", file=tmp_path / "image.npy", labels=labels, pixel=0.1))
    block, pieces = blocks(mesh, 15)
    rectangles = block.reshape(image.shape)
    assert (rectangles == rectangles[:, :1] + rectangles[:1]).all() and (pieces == 1).all()
    assert np.array_equal(np.unique(rectangles), np.arange(len(pieces))) and len(pieces) == 15
    assert np.ptp(np.bincount(rectangles.ravel())) <= 10  # a column


def test_pieces_have_the_wanted_size(torus):
    load = np.bincount(fine(torus, 2).subdomain)
    assert load.max() <= 1.25 * 20
    assert np.median(load) > 0.6 * 20


@pytest.mark.parametrize("n_ranks", [2, 3, 4, 12])
def test_ranks_are_balanced_and_their_subdomains_together(torus, n_ranks):
    decomposition = fine(torus, n_ranks)
    load = np.bincount(decomposition.rank[decomposition.subdomain], minlength=n_ranks)
    assert load.max() < 1.05 * load.mean()
    left, right = edge_pairs(torus.triangle_torus_edges)
    a, b = decomposition.subdomain[left], decomposition.subdomain[right]
    between = a != b
    remote = decomposition.rank[a] != decomposition.rank[b]
    # Assigned at random, a share of 1 - 1 / n_ranks of the neighbours would be on other ranks.
    assert remote.sum() < 0.5 * (1 - 1 / n_ranks) * between.sum()


def test_few_subdomains_are_assigned_by_size_to_as_many_ranks(torus):
    whole = decompose(torus, torus.constituent, np.ones(17, np.int64), 2)
    load = np.bincount(whole.subdomain)
    largest = np.bincount(whole.rank, load).max()
    assert largest <= 1.05 * max(load.max(), load.sum() / 2)
    whole = decompose(torus, torus.constituent, np.ones(17, np.int64), 40)
    assert len(np.unique(whole.rank)) == 17


def test_pieces_for_count_halves_the_largest():
    assert pieces_for_count(np.array([100, 10, 10]), 5).tolist() == [3, 1, 1]
    assert pieces_for_count(np.array([100, 10, 10]), 2).tolist() == [1, 1, 1]
    assert pieces_for_count(np.array([2, 2]), 9).tolist() == [2, 2]


@pytest.mark.slow
def test_cuts_are_short():
    """On the mean over cells shorter than where every edge counts alike; METIS itself scatters by 3 % a cell."""
    ratios = [
        cut_length(cell) / cut_length(cell, length_classes=1) for cell in (torus_of(8, k, 0.04) for k in range(8))
    ]
    assert np.mean(ratios) < 0.98, ratios


def cut_length(torus, **options):
    """Length of all edges along which bodies are cut into pieces of about 20 triangles."""
    left, right = edge_pairs(torus.triangle_torus_edges)
    length = torus.edge_lengths[torus.sides[2]]
    subdomain = fine(torus, 1, **options).subdomain
    within = torus.constituent[left] == torus.constituent[right]
    return length[within & (subdomain[left] != subdomain[right])].sum()


def test_subdomains_that_ranks_cut_are_those_of_the_whole_cell(torus):
    """Each against the triangles, classes and edges of the torus that it has."""
    decomposition = fine(torus, 3)
    table, pinned = SubdomainTable.of(torus, decomposition.subdomain, decomposition.rank), pinned_classes(torus)
    found = {}
    for r, own in enumerate(cut_for_ranks(torus, decomposition.subdomain, table, 3, pinned)):
        assert np.all(decomposition.rank[own.index] == r) and own.loads.sum() == len(own.member)
        found |= {submesh.index: submesh for submesh in own.cut()}
    assert sorted(found) == list(range(len(decomposition.rank)))
    *_, idle = cut_for_ranks(torus, decomposition.subdomain, table, 4, pinned)
    assert idle.cut() == [] and len(idle.loads) == 0
    assert sum(len(submesh.pinned) for submesh in found.values()) >= 1
    mesh = torus.mesh
    for index, submesh in found.items():
        members = np.flatnonzero(decomposition.subdomain == index)
        assert submesh.body == torus.constituent[members[0]] and submesh.phase == mesh.phases[mesh.phase[members[0]]]
        assert np.array_equal(submesh.points[submesh.triangles], mesh.points[mesh.triangles[members]])
        keys = submesh.class_keys[submesh.vertex_class[submesh.triangles]]
        assert np.array_equal(keys, torus.node_class[mesh.triangles[members]])
        edges = submesh.edge_keys[submesh.edge_class[submesh.triangle_edges]]
        assert np.array_equal(edges, torus.triangle_torus_edges[members])
        starts = submesh.edges[submesh.triangle_edges, submesh.backwards.astype(int)]
        assert np.array_equal(starts, submesh.triangles)
