"""Mesh label images with voids, and cut pixels into triangles."""

import numpy as np
import pytest
from support.pixel_images import case, random_image

from feti_homog.errors import MeshError
from feti_homog.mesh import Torus, refinement
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.fill import pixel_mesher
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, pinned_classes


def with_voids(tmp_path, image, **cell):
    """Return the mesh of an image with matrix, fibre and void."""
    return pixel_mesher.read_cell(case(tmp_path / "a.npy", image, ("matrix", "fibre", "void"), **cell).cell)


@pytest.mark.parametrize("cell", [{}, {"window": "mirrored"}, {"boundary": "displacement"}])
def test_meshes_leave_voids_open(tmp_path, cell):
    image = np.zeros((6, 7), int)
    image[2, 2], image[5, 3:5], image[0, 4], image[0, 0] = 1, 2, 2, 2
    mesh, copies = with_voids(tmp_path, image, pixel=0.5, **cell), 4 if "window" in cell else 1
    assert mesh.phases == ("matrix", "fibre") and len(mesh.triangles) == 38 * copies
    assert areas(mesh.points, mesh.triangles) == pytest.approx(0.125) and mesh.period.prod() == 10.5 * copies
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.points)))
    period = mesh.period if "boundary" not in cell else np.full(2, np.inf)
    offset = np.abs(mesh.points - mesh.points[mesh.representative])
    assert (np.isin(offset, [0.0, *period])).all()
    keys = {tuple(point) for point in np.mod(mesh.points, period).tolist()}
    assert len(keys) == len(np.unique(mesh.representative))


@pytest.mark.parametrize("cell", [{}, {"boundary": "displacement"}])
def test_halves_of_pixels_share_diagonals_between_even_nodes(tmp_path, cell):
    image = random_image(8, 5, phases=2)
    image[2, 2:4], image[7, 6] = 2, 2
    torus = Torus.of(with_voids(tmp_path, image, pixel=0.5, **cell))
    subdomain = np.random.default_rng(1).integers(0, 3, len(torus.constituent))
    table = SubdomainTable.of(torus, subdomain, np.zeros(3, np.int64), across=True)
    (own,) = cut_for_ranks(torus, subdomain, table, 1, pinned_classes(torus))
    found = []
    for number, submesh in enumerate(map(refinement.halved, own.cut())):
        triangles, ends = submesh.triangles, submesh.edges[submesh.triangle_edges]
        sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
        forwards = np.where(submesh.backwards[..., None], sides[..., ::-1], sides)
        assert np.array_equal(ends, forwards) and areas(submesh.points, triangles) == pytest.approx(0.125)
        assert np.array_equal(submesh.constituent[::2], torus.constituent[subdomain == number])
        assert (np.diff(submesh.edge_keys) > 0).all() and len(submesh.at_void) == len(submesh.edge_keys)
        lower, upper = submesh.points[submesh.edges].transpose(1, 0, 2)
        assert ((lower[:, 0] < upper[:, 0]) | ((lower[:, 0] == upper[:, 0]) & (lower[:, 1] < upper[:, 1]))).all()
        diagonal = (lower != upper).all(axis=1)
        assert not ((lower[diagonal] / 0.5).sum(axis=1) % 2).any() and diagonal.sum() == len(triangles) // 2
        found.append(submesh.edge_keys[submesh.edge_class[diagonal]])
    assert len(np.unique(np.concatenate(found))) == len(subdomain)
    assert min(map(min, found)) > max(torus.edge_keys)


def test_voids_part_nothing_and_leave_sides_to_tractions(tmp_path):
    image = np.zeros((6, 6), int)
    image[1:4, 1:4], image[2, 2] = 2, 1
    line = "a.npy: floating parts, .*: the part of 1 pixels around row 4, column 3; expected the label of a void"
    with pytest.raises(MeshError, match=line):
        with_voids(tmp_path, image)
    with pytest.raises(MeshError, match="voids at the sides"):
        with_voids(tmp_path, np.roll(np.where(image == 1, 2, image), 4), boundary="traction", labels=SOLID_AND_VOID)


SOLID_AND_VOID = {"0": "matrix", "2": "void"}


def test_parts_join_across_the_period_alone(tmp_path):
    image = np.zeros((6, 6), int)
    image[:, 3], image[0, 0] = 2, 1
    with_voids(tmp_path, image)
    with pytest.raises(MeshError, match=r"floating parts, .*: the part of 12 pixels around row 6, column 5"):
        with_voids(tmp_path, image, boundary="displacement")


def test_no_corner_of_smooth_outlines_lies_in_a_void(tmp_path):
    """Although each row and column crosses one of two voids."""
    x = np.arange(48) + 0.5
    image = np.any([np.hypot(x[None] - c, x[:, None] - c) < 13 for c in (12, 36)], axis=0).astype(int)
    mesh = pixel_mesher.read_cell(case(tmp_path / "a.npy", image, ("matrix", "void"), smooth=True, order=2).cell)
    corners = [[0.0, 0.0], [48.0, 0.0], [48.0, 48.0], [0.0, 48.0]]
    assert all((mesh.points == corner).all(axis=1).any() for corner in corners)
    assert areas(mesh.points, mesh.triangles).sum() == pytest.approx(48**2 - 2 * np.pi * 13**2, rel=0.03)
