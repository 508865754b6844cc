"""All subdomains of this rank as the dual problem sees them: through their boundary dofs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from petsc4py import PETSc
from scipy.sparse import block_diag, csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain, both_directions
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.operators.implicit import ImplicitInterfaceOperator, Interior
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.typing import Float, Int

# Boundary dofs of a subdomain up to which dense matrices (8 n^2 bytes) are ever chosen by themselves.
LARGEST_DENSE = 6000
# Seconds, up to a common factor, for the choice: of a dense inverse per n^3, and of one application of the dual
# operator and the preconditioner by triangular solves per dof (both measured with `scripts/benchmark_path`).
INVERSE, SOLVES = 5e-10, 3.5e-7


class InterfaceOperators:
    """The boundary dofs of this rank's subdomains, one subdomain after the other, n in all.

    Attributes:
        dofs: local numbers, sorted, of each subdomain's.
        offsets: where each subdomain begins among the n.
        operators: dense or factored, of each subdomain.
        large: whether each is a whole body, and its boundary too large for one dense eigenproblem.
        B: (local rows, n) the constraints on them.
        diagonal: (n,) of K.
    """

    def __init__(
        self,
        jump_operator: JumpOperator,
        subdomains: Sequence[Subdomain],
        kind: str,
        applications: int,
        soft: bool,
        largest_whole: int = DEFAULTS.whole_boundary_dofs,
    ) -> None:
        """Factor every subdomain, once.

        Args:
            kind: auto, implicit or explicit; auto is dense where that pays.
            applications: how many times the operators are expected to be applied.
            soft: whether soft modes will be looked for, which takes dense matrices but of large bodies.
            largest_whole: boundary dofs above which a whole body is large.
        """
        self.subdomains = subdomains
        self.dofs = _touched(jump_operator.B, subdomains)
        self.offsets = np.cumsum([0, *(len(d) for d in self.dofs)])
        first = np.cumsum([0, *(s.K.shape[0] for s in subdomains)])
        self.local = np.concatenate([o + d for o, d in zip(first, self.dofs, strict=False)] or [np.zeros(0, np.int64)])
        self.B = jump_operator.B[:, self.local].tocsr()
        self.BT = self.B.T.tocsr()
        diagonals = [s.K.diagonal()[d] for s, d in zip(subdomains, self.dofs, strict=True)]
        self.diagonal = np.concatenate([np.zeros(0), *diagonals])
        whole = _whole(jump_operator.shared, [s.submesh.index for s in subdomains])
        self.large = [w and len(d) > largest_whole for w, d in zip(whole, self.dofs, strict=True)]
        self.operators: list[ExplicitInterfaceOperator | ImplicitInterfaceOperator] = []
        for subdomain, dofs, large in zip(subdomains, self.dofs, self.large, strict=True):
            pays = INVERSE * len(dofs) ** 3 <= SOLVES * subdomain.K.shape[0] * applications
            pays = pays or (soft and not large)
            dense = kind == "explicit" or (kind == "auto" and pays and _fits(len(dofs)))
            self.operators.append(
                ExplicitInterfaceOperator(subdomain, dofs)
                if dense and len(dofs)
                else ImplicitInterfaceOperator(subdomain, dofs)
            )
            subdomain.release()

    @property
    def spans(self) -> list[slice]:
        """The dofs of each subdomain among the n."""
        return [slice(a, b) for a, b in pairwise(self.offsets.tolist())]

    def stiffness(self, x: Float) -> Float:
        """S x for x (n,) or (n, k)."""
        return self._each([o.stiffness for o in self.operators], x)

    def flexibility(self, x: Float) -> Float:
        """The boundary part of K+ x for x (n,) or (n, k)."""
        return self._each([o.flexibility for o in self.operators], x)

    def _each(self, applied: Sequence[Callable[[Float, Float], None]], x: Float) -> Float:
        x = np.asfortranarray(x)
        y = np.empty(x.shape, order="F")
        for apply, (first, last) in zip(applied, pairwise(self.offsets.tolist()), strict=True):
            apply(x[first:last], y[first:last])
        return y

    @cached_property
    def Kbb(self) -> csr_matrix:
        """(n, n) boundary block of K."""
        blocks = [s.K[d][:, d] for s, d in zip(self.subdomains, self.dofs, strict=True)]
        return csr_matrix(block_diag(blocks or [csr_matrix((0, 0))]))

    @cached_property
    def _interiors(self) -> list[Interior]:
        interiors = []
        for subdomain, dofs, operator in zip(self.subdomains, self.dofs, self.operators, strict=True):
            interiors.append(
                operator.interior if isinstance(operator, ImplicitInterfaceOperator) else Interior(subdomain, dofs)
            )
            subdomain.release()
        return interiors

    def extend(self, x: Float) -> Float:
        """(local dofs,) displacements that have the values x (n,) on the boundaries, with interiors in equilibrium.

        The first call factors the interiors.
        """
        parts = [np.zeros(0)]
        for subdomain, dofs, interior, span in zip(
            self.subdomains, self.dofs, self._interiors, self.spans, strict=True
        ):
            u = np.empty(len(subdomain.Q))
            u[dofs], u[interior.dofs] = x[span], interior.extend(x[span])
            parts.append(u)
        return np.concatenate(parts)


def _touched(B: csr_matrix, subdomains: Sequence[Subdomain]) -> list[Int]:
    """Local numbers of the dofs of each subdomain that constraints act on, both directions of a node."""
    touched = B.getnnz(axis=0).reshape(-1, 2).any(axis=1)
    nodes = np.split(touched, np.cumsum([s.mesh.n_classes for s in subdomains]))[:-1]
    return [both_directions(np.flatnonzero(n)) for n in nodes]


def _whole(shared: SharedEntities, subdomains: Sequence[int]) -> list[bool]:
    """Whether all that each of the subdomains shares, it shares with one other body."""
    entity = np.repeat(np.arange(len(shared.key)), shared.copies)
    first, last = shared.pointer[:-1], shared.pointer[1:] - 1
    pairs = (shared.copies == 2) & (shared.body[first] != shared.body[last])
    broken = set(shared.sharer[~pairs[entity]].tolist())
    return [s not in broken for s in subdomains]


def _fits(boundary: int) -> bool:
    """Whether dense matrices of that many boundary dofs can be made."""
    return boundary <= LARGEST_DENSE and bool(PETSc.Sys.hasExternalPackage("mumps"))
