"""G^T A G for active rows A = diag(a): linear in a, so that its entries are Q a with a matrix Q that is made once."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.mesh.periodic_topology import components
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float, Int


class GramMatrix:
    """Entries of G^T A G in the pattern of G^T G, and its diagonal blocks that are not coupled with each other."""

    def __init__(self, comm: MPI.Intracomm, G: csr_matrix) -> None:
        """`G` (owned rows, m).  Collective."""
        self._comm, self._m = comm, G.shape[1]
        count = np.diff(G.indptr)
        # Pairs of entries of one row.
        row = np.repeat(np.arange(len(count)), count**2)
        within = np.arange(len(row)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
        a, b = G.indptr[row] + within // count[row], G.indptr[row] + within % count[row]
        key = G.indices[a].astype(np.int64) * self._m + G.indices[b]
        diagonal = np.arange(self._m) * (self._m + 1)
        self._keys = np.unique(np.concatenate([diagonal, *comm.allgather(np.unique(key))]))
        entry = np.searchsorted(self._keys, key)
        self._Q = csr_matrix((G.data[a] * G.data[b], (entry, row)), shape=(len(self._keys), G.shape[0]))
        self._rows, self._columns = np.divmod(self._keys, self._m)

    def entries(self, active: Float) -> Float:
        """(entries,) of G^T A G for the owned rows of which `active` is 1, row by row.  Collective."""
        return allreduce_sum(self._comm, self._Q @ active)

    def groups(self, some: Int) -> list[Int]:
        """The numbers `some` in groups that G^T G couples: of each size, (groups, size)."""
        place = np.full(self._m, -1)
        place[some] = np.arange(len(some))
        i, j = place[self._rows], place[self._columns]
        coupled = (i >= 0) & (j >= 0)
        group = components(len(some), i[coupled], j[coupled])
        order, sizes = np.argsort(group, kind="stable"), np.bincount(group)
        starts = np.cumsum(sizes) - sizes
        return [some[order[starts[sizes == size][:, None] + np.arange(size)]] for size in np.unique(sizes)]

    def places(self, members: Int) -> Int:
        """(g, s, s) numbers of the entries that couple the members (g, s) of each group; one too many for none."""
        key = members[:, :, None] * self._m + members[:, None, :]
        at = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.asarray(np.where(self._keys[at] == key, at, len(self._keys)))
