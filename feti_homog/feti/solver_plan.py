"""Choice of preconditioner and coarse space, from the options and the sizes of the problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from feti_homog.errors import CaseError
from feti_homog.feti.operators.choice import KINDS
from feti_homog.feti.thresholds import DEFAULTS, Thresholds

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
        operator: `-feti_dual_operator`, one of KINDS.
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
        """Read the options by `text(name, default)` and `number(name, default)`; names lack `feti_`.

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
            reflects both, so that the Dirichlet preconditioner takes hundreds of iterations or does not converge.
        one_each: whether there are several ranks with one subdomain each, and a subdomain has several materials.
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
        adaptive: whether the coarse space has soft modes beside rigid-body motions.
    """

    preconditioner: str
    adaptive: bool

    @property
    def in_words(self) -> str:
        """Return the name of the method, as `check` prints it."""
        if self.preconditioner == "influence":
            return "influence columns, an inverse of the bonded cell"
        if self.preconditioner == BONDED:
            return "inverse of the assembled Schur complement, no iterations"
        name = "no" if self.preconditioner == "none" else self.preconditioner
        return f"{name} preconditioner, {'adaptive' if self.adaptive else 'natural'} coarse space"


def choose(sizes: ProblemSizes, options: SolverOptions, thresholds: Thresholds = DEFAULTS) -> SolverPlan:
    """Choose the preconditioner and the coarse space from sizes and options.

    By default, influence columns serve dense problems with a thin body, and dense problems with at least
    `influence_applications` products and at most `assembled_schur_dofs` shared dofs; BONDED serves `one_each` with at
    most `dense_boundary_dofs` shared dofs, "dirichlet" all other problems.

    Raises:
        CaseError: two options exclude each other.
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
