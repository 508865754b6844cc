"""The cells of the tests of the adaptive coarse space."""

import numpy as np
from mpi4py import MPI
from reference import dense_feti
from scipy.linalg import eigh

from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.system.petsc.options_database import case_options
from support import torn_cells
from support.cases import relative_error

# Sixteen fibres almost touch; the matrix is cut across the gaps.
NARROW = {
    "geometry": "random", "fibres": 16, "fibre_fraction": 0.5, "min_gap": 0.02, "mesh_size": 0.12, "seed": 1,
    "decomposition": {"subdomains": 24},
}  # fmt: skip
# Many rows of few subdomains, so that many may be inactive.
BREAKING = {"geometry": "hexagonal", "mesh_size": 0.12, "refine": 1, "decomposition": {"subdomains": 8}}
STRAINS = np.eye(3)
# Of the largest eigenvalue and 1 / threshold.
BOUND = 1.3
# Subdomains may exchange N in single precision.
SINGLE = 2e-6


class Narrow:
    """The narrow cell, its dense dual problem, and preconditioners as dense matrices.

    These are the preconditioner without coarse space, M, that of dense modes, and what the program applies, H.
    """

    def __init__(self):
        """Solve the dense dual problem.  Collective."""
        self.cell = torn_cells.tear(MPI.COMM_WORLD, **NARROW)
        self.solver = self.cell.solver
        self.coarse = self.solver.adaptive
        self.dense = dense_feti.DenseDual(self.cell)
        self.all = np.ones(self.dense.total, bool)
        self.M = self.dense.preconditioner(self.all)
        self.H = dense_feti.matrix(self.cell, self.solver.preconditioner.apply)

    def soft_modes(self):
        """For each subdomain: (n,) all theta of S p = theta N p, rising, and (n, n) the modes."""
        for B, S in zip(self.dense.B, self.dense.S, strict=True):
            yield eigh(S, B.T @ self.M @ B)

    def own(self, whole):
        """Return this rank's rows."""
        first, last = self.solver.jump_operator.owned
        return whole[first:last]

    def random(self, seed, columns=()):
        """Return a vector on all rows."""
        return np.random.default_rng(seed).standard_normal((self.dense.total, *columns))


def solve_many(cell, strains=STRAINS, starts=None):
    """Return the dual solutions under some strains, with the options of the case."""
    with case_options(cell.case.petsc):
        zero = np.zeros((cell.solver.rows, len(strains)))
        return cell.solver.solve_many(strains, zero if starts is None else starts)


def of_all(comm, coarse, cell):
    """Soft modes of all subdomains in the order of their numbers."""
    own = zip((s.submesh.index for s in cell.subdomains), coarse.counts, strict=True)
    return [count for _, count in sorted(pair for part in comm.allgather(list(own)) for pair in part)]


def statuses(cell, seed):
    """Statuses of this rank's nodes: an arc of each fibre open, some more nodes open or closed, at random."""
    rng, nodes = np.random.default_rng(seed), cell.solver.jump_operator.nodes
    points = np.concatenate(cell.comm.allgather(nodes.points))
    place = np.empty(len(points), int)
    place[np.lexsort(np.round(points, 8).T)] = np.arange(len(points))
    first = cell.comm.exscan(len(nodes.row)) or 0
    draws = rng.random(len(points))[place[first : first + len(nodes.row)]]
    away = (cell.directions - rng.uniform(0, 360) + 180) % 360 - 180
    status = np.where(draws < 0.1, OPEN, np.where(draws < 0.25, CLOSED, BONDED))
    return np.where(np.abs(away) < 40, OPEN, status).astype(np.int8)


def masks(cell, seeds):
    """Draw statuses at random; returns this rank's active rows.  Collective."""
    interface = torn_cells.interface(cell, True)
    return [interface.active(statuses(cell, seed)) for seed in seeds]


def agree(cell, found, expected):
    """Check that solutions agree.  Collective."""
    for a, b in zip(found, expected, strict=True):
        assert a.reason > 0 and b.reason > 0
        assert relative_error(torn_cells.stress(cell, a), torn_cells.stress(cell, b)) < 1e-8
        lam, other = (dense_feti.gathered(cell, s.lam) for s in (a, b))
        assert relative_error(lam, other) < 1e-6
        jump, other = (dense_feti.gathered(cell, s.jump) for s in (a, b))
        opening = np.abs(dense_feti.gathered(cell, cell.solver.d)).max()
        assert np.abs(jump - other).max() < 1e-6 * opening
