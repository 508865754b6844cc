"""Construction of boundary operators, preconditioner and coarse spaces, as `solver_plan` chooses them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Dirichlet, Identity, Lumped, Preconditioner, SpringUpdated
from feti_homog.feti.solver_plan import BONDED, ProblemSizes, SolverOptions, choose
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace
    from feti_homog.feti.exact.exact_inverse import ExactInverse


def construct(name: str, operators: InterfaceOperators) -> Preconditioner:
    """Construct the preconditioner `name`, as in `SolverPlan`.  Collective.

    The modules of `feti.exact` are imported only where a preconditioner needs them.
    """
    if name == "influence":
        from feti_homog.feti.exact.exact_inverse import ExactInverse

        return ExactInverse(operators)
    if name == BONDED:
        from feti_homog.feti.exact.reference_cell import BondedInverse

        return BondedInverse(operators)
    return {"none": lambda _: Identity(), "lumped": Lumped, "dirichlet": Dirichlet}[name](operators)


@dataclass(frozen=True)
class SolverParts:
    """The parts of a solver: boundary operators, preconditioner and coarse spaces.

    Attributes:
        adaptive: coarse space of the preconditioner, or None.
        exact_inverse: the preconditioner if it is made from influence columns, else None.
        method: names of preconditioner and coarse space for the summary.
    """

    operators: InterfaceOperators
    preconditioner: Preconditioner
    natural: NaturalCoarseSpace
    adaptive: AdaptiveCoarseSpace | None
    exact_inverse: ExactInverse | None
    method: str

    @property
    def coarse_dimension(self) -> int:
        """Return the number of coarse displacements; without `adaptive`, of rigid-body motions."""
        return self.natural.kernel_dimension if self.adaptive is None else self.adaptive.coarse_dimension

    def describe(self, comm: MPI.Intracomm) -> str:
        """Return the lines that -feti_view prints about subdomains and coarse space.  Collective."""
        operators, adaptive, dimension = self.operators, self.adaptive, self.coarse_dimension
        sizes = np.array([n for part in comm.allgather([len(d) for d in operators.dofs]) for n in part])
        dense = comm.allreduce(sum(o.is_dense for o in operators.operators))
        lines = [
            f"FETI: {len(sizes)} subdomain{'s' * (len(sizes) != 1)}, {dense} with dense boundary operators",
            f"  boundary dofs of a subdomain: {sizes.min()} to {sizes.max()}, mean {sizes.mean():.0f}",
            f"  kernels: {self.natural.kernel_dimension} rigid-body modes",
        ]
        if self.exact_inverse is not None:
            size = self.exact_inverse.reference.assembled.size
            lines.append(f"  influence columns by the bonded cell, {size} dofs on its shared nodes")
        if adaptive is not None:
            counts = np.array([n for part in comm.allgather(adaptive.counts) for n in part])
            numbers = f"{counts.sum()}, at most {counts.max()} of a subdomain, mean {counts.mean():.2f}"
            lines.append(f"  soft modes below {adaptive.threshold:g}: {numbers}")
            facewise = comm.allreduce(sum(operators.facewise))
            lines += [f"  {facewise} examined face by face"] if facewise else []
        lines.append(f"  coarse dimension {dimension}, {dimension / len(sizes):.2f} a subdomain")
        return "\n".join(lines)


def database_options(thresholds: Thresholds = DEFAULTS) -> SolverOptions:
    """Read the solver options from PETSc's database; raise CaseError for an unknown value."""
    database = PETSc.Options("feti_")
    return SolverOptions.read(database.getString, database.getReal, thresholds)


def build(
    comm: MPI.Intracomm,
    jump_operator: JumpOperator,
    subdomains: Sequence[Subdomain],
    applications: int,
    compliance: Float,
    soften: bool,
    thresholds: Thresholds = DEFAULTS,
    recovers: bool = False,
) -> SolverParts:
    """Factor the subdomains, and construct the parts of the solver.  Collective.

    Options: `feti_dual_operator`, `feti_pc_type`, `feti_coarse_space`, `feti_coarse_threshold`.

    Args:
        applications: expected number of products with F.
        compliance: (owned rows,) compliance C of the intact springs, which may grow if they `soften`.
        recovers: whether the run needs interior displacements.  If every rank has one subdomain, its factor is then
            kept, because a second factorization would take the same memory.

    Raises:
        CaseError: the value of an option is unknown, options exclude each other, or a library lacks a factorization.
    """
    options = database_options(thresholds)
    bodies = comm.allreduce(max((s.submesh.body for s in subdomains), default=-1), MPI.MAX) + 1
    are_cut = bool(comm.allreduce(len(subdomains)) > bodies)
    across = comm.allreduce(any(s.material is not None for s in subdomains), MPI.LOR)
    one_each = comm.size > 1 and comm.allreduce(len(subdomains) == 1, MPI.LAND) and across
    springs = jump_operator.gather(compliance) if comm.allreduce(bool(compliance.any()), MPI.LOR) else None
    operator = "explicit" if one_each and options.operator == "auto" else options.operator
    how = operator, applications, options.want_soft_modes(are_cut), thresholds, springs, recovers and one_each
    with PETSc.Log.Event("FETISubdomains"):
        operators = mpi_errors.agree(comm, InterfaceOperators, jump_operator, subdomains, *how)
    dense = [operator.is_dense for operator in operators.operators]
    sizes = ProblemSizes(
        applications=applications,
        bodies_are_cut=are_cut,
        all_dense=comm.allreduce(all(dense), MPI.LAND),
        all_searchable=comm.allreduce(all(np.logical_or(dense, operators.facewise)), MPI.LAND),
        shared_dofs=jump_operator.shared_dofs,
        has_thin=comm.allreduce(any(s.is_thin for s in subdomains), MPI.LOR),
        one_each=one_each,
    )
    plan = choose(sizes, options, thresholds)
    preconditioner = construct(plan.preconditioner, operators)
    with PETSc.Log.Event("FETINatural"):
        natural = NaturalCoarseSpace(operators)
    adaptive = None
    if plan.adaptive and isinstance(preconditioner, Dirichlet):
        from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace, Balanced  # with its eigenproblems

        with PETSc.Log.Event("FETICoarseSetUp"):
            adaptive = AdaptiveCoarseSpace(operators, preconditioner, options.threshold, thresholds)
        preconditioner = Balanced(preconditioner, adaptive)
    neglected = operators.compliance if plan.preconditioner == "dirichlet" else np.zeros(len(compliance))
    followed = plan.preconditioner == "influence" or not soften
    if not followed or comm.allreduce(bool(neglected.any()), MPI.LOR):
        preconditioner = SpringUpdated(comm, preconditioner, jump_operator.owned[0], neglected)
    inverse = cast("ExactInverse", preconditioner) if plan.preconditioner == "influence" else None
    return SolverParts(operators, preconditioner, natural, adaptive, inverse, plan.in_words)
