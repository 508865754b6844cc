"""Cells cut into tiles: meshes that join up, where their borders run, faults, and the torus of tiles.

The whole mesh has the same triangles in the same order.
"""

from dataclasses import replace
from functools import cache

import gmsh
import numpy as np
import pytest
from support import generated_meshes
from support.generated_meshes import generate
from support.tiled_cells import CELLS, SMALL, mesh_of, noded
from unit.mesh.fill.test_gmsh_mesher import least_angle

from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.fill.gmsh_mesher import begin
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE
from feti_homog.mesh.outline.outline import images
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, joined
from feti_homog.mesh.tiles import tile_filling
from feti_homog.mesh.tiles.matrix_faces import CLEAR, LEAST_ANGLE
from feti_homog.mesh.tiles.tile_filling import fill
from feti_homog.mesh.tiles.tiling import FilledTile, TilePolicy, is_tiled, tile_torus, tiling
from feti_homog.microstructure.arrangements import Arrangement
from feti_homog.microstructure.shapes.shapes import elliptic

NONE = TilePolicy(least_discs=10**6)
MARKS = {0: (20.0, 100.0), 7: (0.0, 180.0)}
named = pytest.mark.parametrize("name", CELLS)


@named
def test_tiles_make_one_mesh_of_the_torus(name):
    mesh = mesh_of(name)
    torus = Torus.of(mesh)
    beside = np.bincount(torus.triangle_torus_edges.ravel())
    voids = len(arrange(CELLS[name]).radii) - arrange(CELLS[name]).fibres
    assert beside.max() == 2 and torus.at_void.any() == (voids > 0)
    # Each void takes a disc out of a surface whose characteristic is that of the torus, 0.
    assert torus.node_class.max() + 1 - len(beside) + len(mesh.triangles) == -voids
    fibres = arrange(CELLS[name]).fibres
    assert torus.constituent.max() == fibres * (2 if "coated" in name else 1)
    assert set(mesh.triangles.ravel()) == set(range(len(mesh.points)))


@pytest.mark.slow
@named
def test_tiles_have_the_areas_and_circles_of_the_cell_at_once(name):
    mesh = mesh_of(name)
    assert areas(mesh.points, mesh.triangles).min() > 0
    whole = generate(CELLS[name], policy=NONE)
    for of_phase in range(len(mesh.phases)):
        own, other = (areas(m.points, m.triangles)[m.phase == of_phase].sum() for m in (mesh, whole))
        # Arcs have other edges where bridges end.
        assert own == pytest.approx(other, rel=1e-2)
    assert np.array_equal(mesh.ellipses.circles, whole.ellipses.circles)
    assert 0.9 < len(mesh.triangles) / len(whole.triangles) < 1.6
    angles = [np.quantile(least_angle(m.points, m.triangles), [0.0, 0.01]) for m in (mesh, whole)]
    assert np.all(angles[0] > angles[1] - 4)


@named
def test_bridges_cross_the_matrix_and_nothing_else(name):
    lines = noded(name).lines
    curves, circles = lines.curves, lines.ellipses.circles
    bridge = np.flatnonzero((curves.circle == MATRIX) & (curves.inside == MATRIX) & (curves.outside == MATRIX))
    ends = lines.points[
        np.stack([curves.node[curves.first[bridge]], curves.node[curves.first[bridge + 1] - 1]], axis=1)
    ]
    share = np.linspace(0.0, 1.0, 51)[1:-1, None, None]
    inside = ends[:, 0] * (1 - share) + ends[:, 1] * share
    distance = np.linalg.norm(inside[:, :, None] - circles[:, :2], axis=3) - circles[:, 2]
    assert len(bridge) > 4 and distance.min() > 0 and inside.min() > 0 and inside.max() < 1
    # From circle to circle at right angles, away from all others.
    distance = np.linalg.norm(ends[:, :, None] - circles[:, :2], axis=3) - circles[:, 2]
    own = np.abs(distance).argmin(axis=2)
    assert np.abs(np.take_along_axis(distance, own[:, :, None], axis=2)).max() < 1e-12
    spokes = ends - circles[own, :2]
    way = ends[:, 1] - ends[:, 0]
    turn = spokes[..., 0] * way[:, None, 1] - spokes[..., 1] * way[:, None, 0]
    assert np.abs(turn / np.linalg.norm(spokes, axis=2) / np.linalg.norm(way, axis=1)[:, None]).max() < 1e-9
    outer = np.flatnonzero(lines.around == MATRIX)
    away = np.linalg.norm(inside[:, :, None] - circles[outer, :2], axis=3) / circles[outer, 2]
    third = (outer != own[:, :1]) & (outer != own[:, 1:])
    assert np.where(third[None], away, np.inf).min() > 1 + CLEAR - 1e-9
    for circle in np.unique(own):
        angle = np.sort(np.arctan2(*spokes[own == circle][:, ::-1].T))
        assert np.all(np.diff(angle, append=angle[0] + 2 * np.pi) > LEAST_ANGLE - 1e-9)


def test_marks_become_nodes_and_bridges_keep_away():
    case = CELLS["dense"]
    arrangement, mesh = arrange(case), generate(case, MARKS, SMALL)
    for fibre, angles in MARKS.items():
        for angle in np.radians(angles):
            place = arrangement.centres[fibre] + arrangement.radii[fibre] * np.array([np.cos(angle), np.sin(angle)])
            assert np.linalg.norm((mesh.points - place + 0.5) % 1.0 - 0.5, axis=1).min() < 1e-12
    torus = Torus.of(mesh)
    assert np.all(np.bincount(torus.triangle_torus_edges.ravel()) == 2)
    assert least_angle(mesh.points, mesh.triangles).min() > 15


def test_bridges_keep_away_from_all_of_some_near_marks():
    """The second in the direction of a bridge that is there without them."""
    case = CELLS["dense"]
    arrangement = arrange(case)
    disc = images(arrangement)[1]
    found = tiling(arrangement, case.mesh_size, {}, SMALL).bridges
    ends, angles = found.on_circles
    fibre, angle = int(disc[ends[0]]), float(np.degrees(angles[0]))
    marked = tiling(arrangement, case.mesh_size, {fibre: (angle - 10, angle, angle + 10)}, SMALL).bridges
    ends, angles = marked.on_circles
    away = np.degrees(angles[disc[ends] == fibre]) - angle
    assert np.all(np.abs((away + 180) % 360 - 180) > np.degrees(LEAST_ANGLE) - 1e-9)


def test_fibres_in_a_row_are_one_tile():
    """No three of their centres make a triangle."""
    row = Arrangement.of_discs(
        1.0, 0.2, np.array([[(k + 0.5) / 8, 0.1] for k in range(8)]), np.full(8, 0.04), ("fibre",) * 8
    )
    assert is_tiled(row, SMALL) and tiling(row, 0.05, {}, SMALL) is None


def test_what_is_in_a_tile_is_of_it_alone():
    found = noded("dense")
    edges = np.zeros(len(found.lines.points), int)
    for tile in found.parts:
        assert np.array_equal(tile.points, found.lines.points[tile.nodes])
        bounds = (tile.curves.inside != OUTSIDE).astype(int) + (tile.curves.outside != OUTSIDE)
        assert bounds.min() == 1
        edges[tile.nodes] += 1
    # Within a tile, on a border of two, and where a bridge begins on a fibre that is in a third.
    assert edges.min() == 1 and edges.max() in (2, 3)


def test_order_of_filling_does_not_matter():
    found = noded("dense")
    backwards = [tile_filling.fill(tile) for tile in reversed(found.parts)][::-1]
    mesh = found.mesh(backwards)
    assert np.array_equal(mesh.points, mesh_of("dense").points)
    assert np.array_equal(mesh.triangles, mesh_of("dense").triangles)


def test_small_cells_and_other_shapes_are_not_tiled():
    arrangement = arrange(CELLS["dense"])
    assert is_tiled(arrangement, TilePolicy(least_discs=36)) and not is_tiled(arrangement, TilePolicy(least_discs=37))
    assert not is_tiled(replace(arrangement, outlines=elliptic(arrangement.outlines)), SMALL)
    assert len(generated_meshes.noded(begin(CELLS["dense"], None, {}, TilePolicy(least_discs=37))).parts) == 1


def test_a_tile_that_gmsh_leaves_unfilled_is_reported(monkeypatch):
    tile = noded("dense").parts[0]
    add = tile_filling._add_surfaces

    def without_last(gmsh, own):
        surfaces, circle, area = add(gmsh, own)
        return surfaces[:-1], circle[:-1], area

    monkeypatch.setattr(tile_filling, "_add_surfaces", without_last)
    with pytest.raises(MeshError, match=r"gmsh cannot fill the part from \(0, 0\) to .*: triangles are missing"):
        tile_filling.fill(tile)


def test_a_tile_that_gmsh_fails_on_is_reported(monkeypatch):
    def broken(dimension):
        raise RuntimeError(f"no mesh of dimension {dimension}")

    monkeypatch.setattr(gmsh.model.mesh, "generate", broken)
    with pytest.raises(MeshError, match=r"gmsh cannot fill the part .*: no mesh of dimension 2; expected another"):
        tile_filling.fill(noded("dense").parts[0])


filled_ones = pytest.mark.parametrize("name", ["dense", "dilute", "coated, voids", "wide"])


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
@filled_ones
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


@filled_ones
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
