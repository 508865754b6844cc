"""Nodes on the lines of a cell: those of a line do not depend on the lines that are looked at with it."""

from dataclasses import replace
from pickle import dumps, loads

import numpy as np
import pytest
from support.tiled_cells import CELLS, SMALL

from feti_homog.errors import MeshError
from feti_homog.mesh.fill.gmsh_mesher import begin
from feti_homog.mesh.outline.lines import Stations
from feti_homog.mesh.outline.outline import vertex_angles
from feti_homog.microstructure.shapes import Discs, Ellipses


def bare_of(name):
    return begin(CELLS[name], None, {}, SMALL).bare


@pytest.mark.parametrize("count", [3, 400])
@pytest.mark.parametrize("name", ["dense", "coated, voids", "fine interfaces", "wide"])
def test_nodes_are_the_same_in_parts(name, count):
    """To the last bit, also where parts have no lines; sizes and lines may have come from another process."""
    bare = bare_of(name)
    field, parts = loads(dumps((bare.field, bare.lines.parts(count))))
    assert [len(lines) for lines in (bare.lines.arcs, bare.lines.bridges)] == [
        sum(len(getattr(part, kind)) for part in parts) for kind in ("arcs", "bridges")
    ]
    found = bare.lines.joined([part.stations(field) for part in parts])
    for mine, whole in zip(found, bare.lines.stations(bare.field), strict=True):
        assert len(whole.share) > 0
        assert np.array_equal(mine.share, whole.share) and np.array_equal(mine.first, whole.first)
        assert mine.edges == pytest.approx(whole.edges, rel=1e-12)


def test_stations_go_from_end_to_end():
    bare = bare_of("dense")
    stations = bare.lines.stations(bare.field)[0]
    begin, end = stations.first[:-1], stations.first[1:] - 1
    assert not stations.share[begin].any() and (stations.share[end] == 1).all()
    inner = np.diff(stations.line) == 0
    assert (np.diff(stations.share)[inner] > 0).all()
    assert np.array_equal(np.unique(stations.line), np.arange(len(begin)))


def test_too_many_nodes_of_all_parts_are_refused():
    """Though no part has too many."""
    lines = bare_of("dense").lines
    parts = [part.stations(bare_of("dense").field) for part in lines.parts(3)]
    most = int(max(arcs.edges for arcs, _ in parts)) + 1
    few = replace(lines.sampling, most_nodes=most)
    for part in lines.parts(3):
        replace(part, sampling=few).stations(bare_of("dense").field)
    with pytest.raises(MeshError, match=f"nodes; expected at most {most}"):
        replace(lines, sampling=few).joined(parts)
    with pytest.raises(MeshError, match=f"nodes; expected at most {most}"):
        Stations.joined([arcs for arcs, _ in parts], most)


@pytest.mark.parametrize("kind", ["disc", "ellipse"])
def test_marks_at_one_place_are_one_vertex(kind):
    centre = np.array([[0.5, 0.5]])
    disc = Discs(centre, np.array([0.3]))
    curves = disc if kind == "disc" else Ellipses.of(centre, np.array([0.3]), np.array([0.2]), np.array([30.0]))
    no_crossing = np.zeros(0, np.int64), np.zeros((0, 2))
    number, parameter = vertex_angles(curves, np.zeros(1, np.int64), no_crossing, {0: [20.0, 20.04, 20.1]})
    assert number.tolist() == [0, 0]
    offset = curves[number].points(parameter) - centre
    assert np.degrees(np.arctan2(offset[:, 1], offset[:, 0])) == pytest.approx([20.0, 20.1])
