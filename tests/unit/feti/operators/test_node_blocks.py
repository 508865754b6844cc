"""The inverse of active rows of block-diagonal matrices against NumPy's of the same rows, dense."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.jump_operator import NodeBlocks


@st.composite
def blocks_and_masks(draw):
    """Matrix of blocks (n, n), their sizes, which rows are active, the order in which ranks number the rows."""
    sizes = draw(st.lists(st.integers(1, 6), min_size=1, max_size=8))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    roots = [rng.normal(size=(size, 2 * size)) for size in sizes]
    matrix = block_diag(*(root @ root.T for root in roots))
    active = np.array(draw(st.lists(st.booleans(), min_size=len(matrix), max_size=len(matrix))), float)
    return matrix, np.array(sizes), active, rng.permutation(len(matrix))


def node_blocks(matrix, sizes, rows):
    """Blocks of a matrix whose contribution from this rank has its rows in another order."""
    layout = SimpleNamespace(owned=(0, len(matrix)), rows=rows, node_rows=(np.cumsum(sizes) - sizes, sizes))
    return NodeBlocks(MPI.COMM_SELF, layout, csr_matrix(matrix[np.ix_(rows, rows)]))


@given(blocks_and_masks())
def test_inverse_is_that_of_the_active_rows_and_zero_elsewhere(drawn):
    matrix, sizes, active, rows = drawn
    on = np.flatnonzero(active)
    expected = np.zeros_like(matrix)
    expected[np.ix_(on, on)] = np.linalg.inv(matrix[np.ix_(on, on)])
    found = node_blocks(matrix, sizes, rows).inverse(active).toarray()
    assert np.abs(found - expected).max() <= 1e-9 * max(np.abs(expected).max(), 1.0)
