"""Choose and construct boundary operators, preconditioner and coarse spaces from options and problem sizes.

`choose` is a pure function of options and sizes; `build` factors the subdomains, and constructs the chosen parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators.interface_operators import KINDS, InterfaceOperators
from feti_homog.feti.operators.preconditioners import Dirichlet, Identity, Lumped, Preconditioner, SpringUpdated
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace
    from feti_homog.feti.exact.exact_inverse import ExactInverse

PRECONDITIONERS = ("auto", "none", "lumped", "dirichlet", "influence")
BONDED = "bonded"
"""The preconditioner of bonded cells with one subdomain a rank; no option selects it."""
COARSE_SPACES = ("auto", "natural", "adaptive")
WITHOUT_INVERSE = (
    "[interface] friction: needs influence columns, the default of cells with at most "
    f"{DEFAULTS.assembled_schur_dofs} degrees of freedom on shared nodes; expected -feti_pc_type influence in this cell"
)
"""The message for friction without influence columns."""


@dataclass(frozen=True)
class SolverOptions:
    """The values of the solver options.

    Attributes:
        preconditioner: `-feti_pc_type`, one of PRECONDITIONERS.
        operator: `-feti_dual_operator`, one of KINDS; by default explicit with `-feti_pc_type influence`, else auto.
        coarse_space: `-feti_coarse_space`, one of COARSE_SPACES.
        threshold: `-feti_coarse_threshold`, the bound tau of soft modes.
    """

    preconditioner: str = "auto"
    operator: str = "auto"
    coarse_space: str = "auto"
    threshold: float = DEFAULTS.soft_mode

    @classmethod
    def read(
        cls, text: Callable[[str, str], str], number: Callable[[str, float], float], thresholds: Thresholds = DEFAULTS
    ) -> SolverOptions:
        """Read the options by `text(name, default)` and `number(name, default)`; names omit the prefix `feti_`.

        Raises:
            CaseError: the value of an option is unknown.
        """

        def choice(name: str, allowed: tuple[str, ...], default: str) -> str:
            value = text(name, default)
            if value not in allowed:
                raise CaseError(f"-feti_{name} {value}: expected one of {', '.join(allowed)}")
            return value

        preconditioner = choice("pc_type", PRECONDITIONERS, "auto")
        return cls(
            preconditioner,
            choice("dual_operator", KINDS, "explicit" if preconditioner == "influence" else "auto"),
            choice("coarse_space", COARSE_SPACES, "auto"),
            number("coarse_threshold", thresholds.soft_mode),
        )

    def want_soft_modes(self, bodies_are_cut: bool) -> bool:
        """Return whether to search for soft modes: on request, or by default in cut bodies."""
        return self.coarse_space == "adaptive" or (self.coarse_space == "auto" and bodies_are_cut)


@dataclass(frozen=True)
class ProblemSizes:
    """The properties of the whole problem that determine the solver plan.

    Attributes:
        applications: expected number of products with the dual operator.
        bodies_are_cut: whether there are more subdomains than bodies.
        all_dense: whether all boundary operators are dense.
        all_searchable: whether every subdomain can be searched for soft modes, as a whole or face by face.
        shared_dofs: degrees of freedom on shared nodes, with all bonds intact.
        has_thin: whether a body is thin.  A thin ring bends easily but resists a change of its thickness.  No scaling
            reflects both: with the Dirichlet preconditioner, a solve takes hundreds of iterations or does not converge.
        one_each: whether every one of several ranks has one subdomain, and a subdomain has several materials.
    """

    applications: int
    bodies_are_cut: bool
    all_dense: bool
    all_searchable: bool
    shared_dofs: int
    has_thin: bool = False
    one_each: bool = False


@dataclass(frozen=True)
class SolverPlan:
    """The chosen preconditioner and coarse space.

    Attributes:
        preconditioner: one of PRECONDITIONERS except "auto", or BONDED.
        adaptive: whether the coarse space has soft modes in addition to rigid-body motions.
    """

    preconditioner: str
    adaptive: bool

    @property
    def in_words(self) -> str:
        """Return the names of preconditioner and coarse space, as `check` prints them."""
        if self.preconditioner == "influence":
            return "influence columns, an inverse of the bonded cell"
        if self.preconditioner == BONDED:
            return "inverse of the assembled Schur complement, no iterations"
        name = "no" if self.preconditioner == "none" else self.preconditioner
        return f"{name} preconditioner, {'adaptive' if self.adaptive else 'natural'} coarse space"


def choose(sizes: ProblemSizes, options: SolverOptions, thresholds: Thresholds = DEFAULTS) -> SolverPlan:
    """Choose the preconditioner and the coarse space from sizes and options.

    With dense operators and no option for the adaptive space, the default is influence columns if a body is thin, or if
    at least `influence_applications` products follow and at most `assembled_schur_dofs` dofs are shared.  Otherwise,
    with dense operators and no option for a coarse space, the default is BONDED if `one_each` holds and 1 to
    `dense_boundary_dofs` dofs are shared.  Else it is "dirichlet", with an adaptive coarse space on request, or if
    bodies are cut and all subdomains are searchable.  An option "influence" without shared dofs means "none".

    Raises:
        CaseError: options exclude each other.
    """
    preconditioner = options.preconditioner
    if preconditioner == "influence" and not sizes.shared_dofs:
        preconditioner = "none"  # a single whole body has no multipliers
    if preconditioner == "influence" and not sizes.all_dense:
        raise CaseError("-feti_pc_type influence: needs -feti_dual_operator explicit")
    if preconditioner == "auto":
        pays = sizes.applications >= thresholds.influence_applications
        is_wanted = sizes.has_thin or (pays and sizes.shared_dofs <= thresholds.assembled_schur_dofs)
        is_small = 0 < sizes.shared_dofs <= thresholds.dense_boundary_dofs
        if options.coarse_space != "adaptive" and sizes.all_dense and is_wanted:
            preconditioner = "influence"
        elif options.coarse_space == "auto" and sizes.one_each and sizes.all_dense and is_small:
            preconditioner = BONDED
        else:
            preconditioner = "dirichlet"
    can_balance = sizes.all_searchable and preconditioner == "dirichlet"
    if options.coarse_space == "adaptive" and sizes.shared_dofs and not can_balance:
        raise CaseError("-feti_coarse_space adaptive: needs -feti_pc_type dirichlet, -feti_dual_operator not implicit")
    return SolverPlan(preconditioner, can_balance and options.want_soft_modes(sizes.bodies_are_cut))


def construct(name: str, operators: InterfaceOperators) -> Preconditioner:
    """Construct the preconditioner `name`, as in `SolverPlan`; import `feti.exact` only if needed.  Collective."""
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
        operators, preconditioner: boundary operators S and S+; preconditioner of the dual operator and springs.
        natural, adaptive: natural coarse space; adaptive coarse space of the preconditioner, None without one.
        exact_inverse: the preconditioner if it is made from influence columns, else None.
        method: names of preconditioner and coarse space, from `SolverPlan.in_words`.
    """

    operators: InterfaceOperators
    preconditioner: Preconditioner
    natural: NaturalCoarseSpace
    adaptive: AdaptiveCoarseSpace | None
    exact_inverse: ExactInverse | None
    method: str

    @property
    def coarse_dimension(self) -> int:
        """Return the number of coarse displacements, or of rigid-body motions without `adaptive`."""
        return self.natural.kernel_dimension if self.adaptive is None else self.adaptive.coarse_dimension

    def describe(self, comm: MPI.Intracomm) -> str:
        """Return the lines that -feti_view prints about subdomains and coarse space.  Collective."""
        operators, adaptive, dimension = self.operators, self.adaptive, self.coarse_dimension
        sizes = np.array([n for part in comm.allgather([len(d) for d in operators.dofs]) for n in part])
        dense = comm.allreduce(sum(o.is_dense for o in operators.operators))
        lines = [
            f"FETI: {len(sizes)} subdomain{'' if len(sizes) == 1 else 's'}, {dense} with dense boundary operators",
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
    """Factor the subdomains, and construct the parts of the solver.  Collective; also raises like `InterfaceOperators`.

    Options: `feti_dual_operator`, `feti_pc_type`, `feti_coarse_space`, `feti_coarse_threshold`.

    Args:
        applications: expected number of products with the dual operator.
        compliance, soften: (owned rows,) compliance C of the intact springs, and whether C may grow.
        recovers: whether the run needs interior displacements.  If so, and with `ProblemSizes.one_each`, subdomains
            keep their factors, because a second factorization would take the same memory.

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
        from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace, Balanced  # only adaptive spaces need it

        with PETSc.Log.Event("FETICoarseSetUp"):
            adaptive = AdaptiveCoarseSpace(operators, preconditioner, options.threshold, thresholds)
        preconditioner = Balanced(preconditioner, adaptive)
    neglected = operators.compliance if plan.preconditioner == "dirichlet" else np.zeros(len(compliance))
    followed = plan.preconditioner == "influence" or not soften
    if not followed or comm.allreduce(bool(neglected.any()), MPI.LOR):
        preconditioner = SpringUpdated(comm, preconditioner, jump_operator.owned[0], neglected)
    inverse = cast("ExactInverse", preconditioner) if plan.preconditioner == "influence" else None
    return SolverParts(operators, preconditioner, natural, adaptive, inverse, plan.in_words)
