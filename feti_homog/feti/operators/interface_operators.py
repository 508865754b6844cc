"""The boundary operators of the local subdomains, dense or sparse, and the dual operator, Eq. (36)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.errors import MeshError
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain, label
from feti_homog.feti.operators import one_subdomain
from feti_homog.feti.thresholds import DEFAULTS, DENSE_INVERSE_COST, Thresholds
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.feti.operators.with_springs import BoundaryOperator

InterfaceOperator = one_subdomain.ExplicitInterfaceOperator | one_subdomain.ImplicitInterfaceOperator

KINDS = ("auto", "implicit", "explicit")


@dataclass(frozen=True)
class SubdomainSize:
    """The arguments of `choose` for one subdomain: sizes and properties.

    Attributes:
        dofs: number of degrees of freedom.
        boundary_dofs: number n of degrees of freedom on nodes with constraints.
        is_whole_body: whether exactly one other subdomain, of another body, shares each node.
        has_springs: whether the subdomain is an inner body with springs; then S~ (`with_springs`) is dense.
    """

    dofs: int
    boundary_dofs: int
    is_whole_body: bool
    has_springs: bool = False


def choose(
    sizes: Sequence[SubdomainSize],
    kind: str,
    applications: int,
    soft_modes: bool,
    can_condense: bool,
    thresholds: Thresholds,
) -> tuple[list[bool], list[bool]]:
    """Choose the boundary operators of every subdomain.

    Returns two lists with a flag for every subdomain: whether it gets dense matrices instead of sparse factors, and
    whether soft modes are computed face by face (facewise).

    By default a subdomain with n <= `dense_boundary_dofs` boundary dofs gets dense matrices if the inverse costs less
    than all sparse solves (DENSE_INVERSE_COST n^3 <= dofs x applications), if the subdomain has springs, or if soft
    modes need the whole boundary.  Whole bodies without springs are facewise if n > `whole_boundary_dofs`.

    Args:
        sizes: sizes of the subdomains; both results are in this order.
        kind: the option `-feti_dual_operator`, one of KINDS; a subdomain with n = 0 never gets dense matrices.
        applications: expected number of products with the operators.
        soft_modes: whether soft modes will be computed.
        can_condense: whether PETSc has MUMPS, which condenses subdomains; without it the default is sparse factors.
    """
    chosen_explicit, chosen_facewise = list[bool](), list[bool]()
    for size in sizes:
        n = size.boundary_dofs
        facewise = size.is_whole_body and n > thresholds.whole_boundary_dofs and not size.has_springs
        pays = DENSE_INVERSE_COST * n**3 <= size.dofs * applications
        is_useful = pays or size.has_springs or (soft_modes and not facewise)
        possible = n <= thresholds.dense_boundary_dofs and can_condense
        explicit = kind == "explicit" or (kind == "auto" and is_useful and possible)
        chosen_explicit.append(explicit and n > 0)
        chosen_facewise.append(facewise)
    return chosen_explicit, chosen_facewise


class DualOperator:
    """The dual operator F + C, with F = sum_s B K+ B^T.

    F is symmetric positive definite: B has full row rank, and K+ is definite.

    Attributes:
        compliance: (owned rows,) compliance of the springs, the diagonal of C.
    """

    def __init__(self, boundary: InterfaceOperators, compliance: Float) -> None:
        self.jump_operator, self.boundary, self.compliance = boundary.jump_operator, boundary, compliance

    def apply(self, x: Float) -> Float:
        """Compute (F + C) x for x (owned rows,) or (owned rows, k).  Collective."""
        return self.jump(self.displacement(x)) + distributed_arrays.scale_rows(self.compliance, x)

    def displacement(self, lam: Float) -> Float:
        """Compute K+ B^T lam (boundary dofs, k), see Eq. (34), for multipliers lam (owned rows, k).  Collective."""
        return self.boundary.apply_flexibility(self.boundary.BT @ self.jump_operator.gather(lam))

    def jump(self, u: Float) -> Float:
        """Compute the jumps B u (owned rows, k), Eq. (33), of u (boundary dofs, k).  Collective."""
        return self.jump_operator.sum(self.boundary.B @ u)


class InterfaceOperators:
    """Schur complements S and flexibilities S+ of the local subdomains, on n boundary dofs in all.

    Attributes:
        dofs: for every local subdomain, (n_s,) numbers of its boundary dofs in the subdomain, ascending.
        offsets: (subdomains + 1,) first boundary dof of every subdomain, and n.
        local_dofs: (n,) numbers of the boundary dofs among all dofs of this rank.
        operators: for every subdomain, S and S+ as dense matrices or by sparse factors.
        with_springs: for every subdomain, stiffness S~ and flexibility of the body with its springs, else S and S+.
        facewise: for every subdomain, whether soft modes are computed face by face.
        B, BT: (local rows, n) constraints, and their transpose.
        body_diagonal: (n,) diagonal of K.
        diagonal: (n,) stiffness for scaling jumps: diagonal of K times `Subdomain.compressible_share`, in series with
            the springs of the body.
        interiors: factored interiors by position of the subdomain, kept by `extend`.
        springs: (owned rows,) compliance of the springs.
        compliance: (owned rows,) compliance of the springs of no subdomain, between two cut bodies; else 0.
    """

    def __init__(
        self,
        jump_operator: JumpOperator,
        subdomains: Sequence[Subdomain],
        kind: str,
        applications: int,
        soft_modes: bool,
        thresholds: Thresholds = DEFAULTS,
        compliance: Float | None = None,
        keep_factors: bool = False,
    ) -> None:
        """Factor every local subdomain as `choose` decides, without communication.

        `kind`, `applications` and `soft_modes` are as in `choose`.  `compliance` (local rows,) of the springs is None
        if no rank has springs.  `keep_factors` is as in `ExplicitInterfaceOperator`.  Raises MeshError, perhaps only on
        one rank, if rounding leaves the stiffness of a subdomain without a factor.
        """
        self.comm, self.jump_operator, self.subdomains = jump_operator.comm, jump_operator, subdomains
        self._loads = max([len(jump_operator.problem.loads), *(s.Q.shape[1] for s in subdomains)])
        first = np.cumsum([0, *(s.n_dofs for s in subdomains)])
        # All degrees of freedom of nodes with a constraint.
        constrained = np.split(jump_operator.B.getnnz(axis=0) > 0, first[1:])[:-1]
        nodes = (s.problem.nodes(np.flatnonzero(mask)) for s, mask in zip(subdomains, constrained, strict=True))
        self.dofs = [s.problem.dofs(np.unique(nodes_s)) for s, nodes_s in zip(subdomains, nodes, strict=True)]
        self.offsets = np.cumsum([0, *(len(d) for d in self.dofs)])
        self.local_dofs = np.concatenate([np.zeros(0, np.int64), *map(np.add, first, self.dofs)])
        self.B = jump_operator.B[:, self.local_dofs].tocsr()
        self.BT = self.B.T.tocsr()
        first_row, last_row = jump_operator.owned
        at = int(np.searchsorted(jump_operator.rows, first_row))
        owned = slice(at, at + last_row - first_row)
        self.springs = np.zeros(last_row - first_row) if compliance is None else compliance[owned]
        self.compliance = np.where((jump_operator.copies[owned] > 1).all(axis=1), self.springs, 0.0)
        roots: list[csr_matrix | None] = [None] * len(subdomains)
        if compliance is not None:
            from feti_homog.feti.operators.with_springs import WithSprings, compliance_root  # few cells have springs

            parts = ((self.B[:, span], compliance, jump_operator.copies, self.of_inner[span]) for span in self.slices)
            roots = [compliance_root(*part) for part in parts]
        pieces = jump_operator.shared.pieces
        sizes = [
            SubdomainSize(s.n_dofs, len(dofs), s.submesh.index not in pieces, not s.is_outer and root is not None)
            for s, dofs, root in zip(subdomains, self.dofs, roots, strict=True)
        ]
        has_mumps = PETSc.Sys.hasExternalPackage("mumps")
        explicit, self.facewise = choose(sizes, kind, applications, soft_modes, has_mumps, thresholds)
        self.operators: list[InterfaceOperator] = []
        self.with_springs: list[BoundaryOperator] = []
        self.interiors: dict[int, one_subdomain.Interior] = {}
        bodies, diagonals = [np.zeros(0)], [np.zeros(0)]
        for subdomain, dofs, is_explicit, root in zip(subdomains, self.dofs, explicit, roots, strict=True):
            operator, diagonal = _factor(subdomain, dofs, is_explicit, keep_factors)
            self.operators.append(operator)
            self.with_springs.append(operator if root is None else WithSprings(operator, root, subdomain.R[dofs]))
            bodies.append(diagonal)
            diagonal = diagonal * subdomain.compressible_share
            if root is not None:
                diagonal = 1.0 / (1.0 / diagonal + np.asarray(root.multiply(root).sum(axis=1)).ravel())
            diagonals.append(diagonal)
        self.body_diagonal, self.diagonal = np.concatenate(bodies), np.concatenate(diagonals)

    @cached_property
    def slices(self) -> list[slice]:
        """Return the slice of every subdomain in the n boundary dofs."""
        return [slice(a, b) for a, b in pairwise(self.offsets.tolist())]

    @cached_property
    def of_inner(self) -> Bool:
        """Return the mask (n,) of boundary dofs in inner bodies; of two bonded bodies, only the inner one counts."""
        sizes = np.diff(self.offsets)
        of_inner = np.repeat(np.array([not s.is_outer for s in self.subdomains], bool), sizes)
        body = np.repeat(np.array([s.submesh.body for s in self.subdomains], np.int64), sizes)
        inside = self.jump_operator.inside
        between = np.flatnonzero(inside >= 0)
        entries = self.B[between].tocoo()
        of_inner[entries.col] = body[entries.col] == inside[between][entries.row]
        return of_inner

    def apply_schur(self, x: Float) -> Float:
        """Compute the forces S x for x (n,) or (n, k)."""
        return self._each([o.apply_schur for o in self.operators], x)

    def apply_with_springs(self, x: Float, which: Sequence[bool] | None = None) -> Float:
        """Compute the forces S~ x for x (n,) or (n, k), with the stiffness S~ of bodies with springs.

        `which` (subdomains,) selects subdomains; the result is 0 on all other subdomains.
        """
        chosen = None if which is None else [k for k, span in enumerate(self.slices) if which[k] and x[span].any()]
        return self._each([o.apply_schur for o in self.with_springs], x, chosen)

    def apply_flexibility(self, x: Float) -> Float:
        """Compute the displacements S+ x, the boundary part of K+ x, for x (n,) or (n, k)."""
        return self._each([o.apply_flexibility for o in self.operators], x)

    def _each(
        self, products: Sequence[Callable[[Float, Float], Float]], x: Float, chosen: Sequence[int] | None = None
    ) -> Float:
        """Apply the products of all or the `chosen` subdomains to their parts of x (n,) or (n, k); 0 elsewhere."""
        x = np.asfortranarray(x)
        y = np.zeros(x.shape, order="F")
        for k in range(len(products)) if chosen is None else chosen:
            products[k](x[self.slices[k]], y[self.slices[k]])
        return y

    @cached_property
    def condensed(self) -> one_subdomain.CondensedLoads:
        """Condense the unit loads of all local subdomains to their boundaries, when first read."""
        v = self._loads
        parts = [operator.condensed for operator in self.operators]
        boundary = np.concatenate([np.zeros((0, v)), *(part.boundary for part in parts)])
        stiffness = sum((part.stiffness for part in parts), np.zeros((v, v)))
        energy = sum((part.energy for part in parts), np.zeros((v, v)))
        return one_subdomain.CondensedLoads(boundary, stiffness, energy)

    def extend(self, place: int, x: Float, loads: Float | None = None, keep: bool = True) -> Float:
        """Extend boundary displacements x (n_s, k) of a subdomain to all its dofs (dofs, k).

        Args:
            place: position of the subdomain on this rank.
            loads: (v, k) amplitudes of the unit loads; None without loads.
            keep: whether to store the interior, if this call has to factor it.
        """
        operator, s = self.operators[place], self.subdomains[place]
        if isinstance(operator, one_subdomain.ExplicitInterfaceOperator) and operator.factor is not None:
            return operator.extend(x, loads)
        if isinstance(operator, one_subdomain.ImplicitInterfaceOperator):
            interior = operator.interior
        elif place in self.interiors:
            interior = self.interiors[place]
        else:
            interior = one_subdomain.Interior(s.take_stiffness(), self.dofs[place], s.elimination_order())
            if keep:
                self.interiors[place] = interior
        u = np.empty((s.n_dofs, *x.shape[1:]))
        inside = None
        if loads is not None and s.loads_inside:
            if interior.answers is not None:  # the subdomain has no boundary
                u[interior.dofs] = interior.answers @ loads
                return u
            inside = s.Q[interior.dofs] @ loads
        u[self.dofs[place]], u[interior.dofs] = x, interior.extend(x, inside)
        return u


def _factor(subdomain: Subdomain, dofs: Int, explicit: bool, keep_factor: bool) -> tuple[InterfaceOperator, Float]:
    """Factor one subdomain; return its boundary operator and the diagonal of K on `dofs` (n_s,).

    The matrix K is taken from the subdomain.  `explicit` selects `ExplicitInterfaceOperator` with its `keep_factor`.

    Raises:
        MeshError: rounding leaves K without a factor.
    """
    K = subdomain.take_stiffness()
    operator: InterfaceOperator
    try:
        if explicit:
            operator = one_subdomain.ExplicitInterfaceOperator(subdomain, K, dofs, keep_factor)
        else:
            operator = one_subdomain.ImplicitInterfaceOperator(subdomain, K, dofs)
    except np.linalg.LinAlgError as error:
        faults = f"its stiffness cannot be factored, {error}; its elements are degenerate"
        raise MeshError(f"{label(subdomain.submesh)}: {faults}") from error
    return operator, K.diagonal()[dofs]
