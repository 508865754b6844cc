"""The torus of tiles against that of the whole mesh, which has the same triangles in the same order."""

from functools import cache

import numpy as np
import pytest
from support.tiled_cells import mesh_of, noded

from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, joined
from feti_homog.mesh.tiles.tile_filling import fill
from feti_homog.mesh.tiles.tiling import FilledTile, tile_torus

named = pytest.mark.parametrize("name", ["dense", "dilute", "coated, voids", "wide"])


@cache
def filled(name):
    """Return the filled tiles, and how many nodes they have."""
    lines, first, tiles = noded(name).parts, noded(name).regions.nodes, []
    for number, own in enumerate(lines):
        tiles.append(FilledTile(number, own, fill(own), first))
        first += len(tiles[-1].filling.inner)
    return tiles, first


def torus_of(name, those=slice(None)):
    tiles, nodes = filled(name)
    return tile_torus(noded(name).regions, tiles[those], nodes)


def are_one_to_one(a, b):
    pairs = np.unique(np.stack([a.ravel(), b.ravel()]), axis=1)
    return all(len(np.unique(side)) == len(side) for side in pairs)


@pytest.mark.slow
@named
def test_all_tiles_are_the_cell(name):
    (torus, tile), whole = torus_of(name), Torus.of(mesh_of(name))
    mesh, other = torus.mesh, whole.mesh
    assert mesh.origin == other.origin == (3.0, -2.0)
    assert np.array_equal(mesh.points[mesh.triangles], other.points[other.triangles])
    assert np.array_equal(torus.constituent, whole.constituent) and np.array_equal(mesh.phase, other.phase)
    assert are_one_to_one(torus.node_class[mesh.triangles], whole.node_class[other.triangles])
    assert are_one_to_one(torus.triangle_torus_edges, whole.triangle_torus_edges)
    assert np.array_equal(torus.at_void[torus.triangle_torus_edges], whole.at_void[whole.triangle_torus_edges])
    for of_edges in ("edge_circles", "edge_turns"):
        found, expected = (getattr(t, of_edges)[t.triangle_edges] for t in (torus, whole))
        assert np.array_equal(found, expected)
    assert np.all(np.diff(torus.class_keys) > 0) and np.all(np.diff(torus.edge_keys) > 0)
    assert set(tile.tolist()) == set(range(len(filled(name)[0])))


@named
def test_each_fibre_is_in_one_tile(name):
    torus, tile = torus_of(name)
    pairs = np.unique(np.stack([torus.constituent, tile]), axis=1)
    in_tiles = np.bincount(pairs[0])
    assert in_tiles[0] > 1 and in_tiles[1:].max() == 1


@pytest.mark.parametrize("name", ["dense", "coated, voids", "wide"])
def test_shares_of_two_ranks_are_those_of_one(name):
    """Subdomains are the constituents within tiles; equal keys mean equal vertices and edges."""
    whole, tile = torus_of(name)
    key = whole.constituent * (tile.max() + 1) + tile
    keys, subdomain = np.unique(key, return_inverse=True)
    body = keys // (tile.max() + 1)
    rank = np.arange(len(keys)) % 2
    table = SubdomainTable(body, rank, np.arange(body.max() + 1), noded(name).regions.phase)
    pinned = int(whole.class_keys[-1])
    expected = list(cut_for_ranks(whole, subdomain, table, 2, pinned))
    half = len(filled(name)[0]) // 2
    parts = []
    for those in (slice(half), slice(half, None)):
        torus, own = torus_of(name, those)
        number = np.searchsorted(keys, torus.constituent * (tile.max() + 1) + own)
        parts.append(list(cut_for_ranks(torus, number, table, 2, pinned)))
    for r in range(2):
        found = joined([parts[0][r], parts[1][r]])
        assert found.phase == expected[r].phase
        for a, b in zip(found.cut(), expected[r].cut(), strict=True):
            assert (a.index, a.body, a.phase) == (b.index, b.body, b.phase)
            assert np.array_equal(a.points[a.triangles], b.points[b.triangles])
            for of_corners in ("vertex_class", "edge_class"):
                numbers = "class_keys" if of_corners == "vertex_class" else "edge_keys"
                corners = ("triangles", "triangle_edges")[of_corners == "edge_class"]
                sides = [getattr(m, numbers)[getattr(m, of_corners)[getattr(m, corners)]] for m in (a, b)]
                assert np.array_equal(*sides)
            assert np.array_equal(a.at_void[a.edge_class[a.triangle_edges]], b.at_void[b.edge_class[b.triangle_edges]])
            assert np.array_equal(a.circles[a.triangle_edges], b.circles[b.triangle_edges])
            assert np.array_equal(a.backwards, b.backwards)
            assert len(a.pinned) == len(b.pinned)


def test_a_rank_without_tiles_has_no_triangles():
    torus, tile = torus_of("dense", slice(0))
    assert len(torus.mesh.triangles) == len(tile) == len(torus.edge_keys) == 0
