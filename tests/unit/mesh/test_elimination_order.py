"""The order of elimination against the fill that it is for."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix, identity

from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.mesh.refinement import FineMesh, ReferenceLattice, elimination_order


def grid(n: int, m: int, refine: int, periodic: bool) -> FineMesh:
    """Return a grid of 2 n m coarse triangles, in an order of no use."""
    lattice = ReferenceLattice.of(refine, 1)
    i, j = (each.ravel() for each in np.mgrid[:n, :m])
    corner = np.stack([i, j], axis=1)
    first, second = (
        [corner + step for step in steps] for steps in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1)))
    )
    corners = np.concatenate([np.stack(first, axis=1), np.stack(second, axis=1)])
    corners = corners[np.random.default_rng(0).permutation(len(corners))]
    places = np.einsum("qk,tkd->tqd", lattice.nodes, corners)
    found, nodes = np.unique(places.reshape(-1, 2), axis=0, return_inverse=True)
    torus = found % (np.array([n, m]) * lattice.intervals) if periodic else found
    classes, node_class = np.unique(torus, axis=0, return_inverse=True)
    nodes = nodes.reshape(len(corners), -1)
    return FineMesh(found.astype(float), nodes, np.zeros(len(nodes), bool), node_class.ravel(), len(classes), lattice)


def fill(mesh: FineMesh, order: np.ndarray, library_orders: bool = False) -> float:
    """Return the entries of CHOLMOD's factor of a matrix of ones between nodes that share an element."""
    triangles = mesh.node_class[mesh.triangles]
    rows, columns = np.repeat(triangles, 3, axis=1).ravel(), np.tile(triangles, (1, 3)).ravel()
    A = csr_matrix((np.ones(len(rows)), (rows, columns))) + 100.0 * identity(mesh.n_classes)
    solver = DirectSolver(A.tocsr()[order][:, order], "test_", is_ordered=not library_orders)
    entries = solver._ksp.getPC().getFactorMatrix().getInfo()["nz_used"]
    solver.destroy()
    return entries


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("n", "refine"), [(64, 0), (32, 1), (4, 4)])
def test_fill_is_below_that_of_minimum_degree(n, refine, periodic):
    mesh = grid(n, n, refine, periodic)
    order = elimination_order(mesh)
    assert np.array_equal(np.sort(order), np.arange(mesh.n_classes))
    assert fill(mesh, order) < fill(mesh, order, library_orders=True)


def test_the_last_nodes_are_those_of_the_cut_that_crosses_fewest_sides():
    """The first cut of a grid goes across its longer side, however the nodes lie."""
    mesh = grid(4, 16, 0, False)
    x, y = mesh.points.T
    order = elimination_order(replace(mesh, points=np.stack([100 * x, y], axis=1)))
    assert set(y[order[-5:]].tolist()) == {8.0}


def test_memory_grows_with_the_mesh_alone():
    """Edges have a number below the square of the node count, which must not become the size of an array."""
    mesh = grid(64, 64, 1, True)
    tracemalloc.start()
    elimination_order(mesh)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1000 * mesh.n_classes
