"""Choice of dense or sparse boundary operators, and of face eigenproblems for soft modes.

`choose` is a pure function of sizes: it needs no mesh and no MPI.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from feti_homog.feti.thresholds import DENSE_INVERSE_COST, Thresholds

KINDS = ("auto", "implicit", "explicit")


@dataclass(frozen=True)
class SubdomainSize:
    """The arguments of `choose` for one subdomain: sizes and properties.

    Attributes:
        dofs: number of degrees of freedom.
        boundary_dofs: number n of degrees of freedom on nodes with constraints.
        is_whole_body: whether every shared node belongs to a single other body.
        has_springs: whether the inner body of springs: its stiffness with springs is a dense matrix.
    """

    dofs: int
    boundary_dofs: int
    is_whole_body: bool
    has_springs: bool = False


@dataclass(frozen=True)
class OperatorChoice:
    """The boundary operators and eigenproblems chosen for one subdomain.

    Attributes:
        explicit: whether the boundary operators are dense matrices, not sparse factorizations.
        facewise: whether soft modes are computed face by face.
    """

    explicit: bool
    facewise: bool


def choose(
    sizes: Sequence[SubdomainSize],
    kind: str,
    applications: int,
    soft_modes: bool,
    can_condense: bool,
    thresholds: Thresholds,
) -> list[OperatorChoice]:
    """Choose the boundary operators of every subdomain.

    By default a subdomain gets dense matrices if n <= `dense_boundary_dofs` and a reason holds: their inverse takes no
    longer than all products by sparse factors, DENSE_INVERSE_COST n^3 <= dofs x applications; or springs; or soft modes
    of the whole boundary.  Whole bodies without springs and n > `whole_boundary_dofs` get soft modes face by face.

    Args:
        sizes: sizes of the subdomains; the result has the same order.
        kind: the option `-feti_dual_operator`, one of KINDS; a subdomain with n = 0 never gets dense matrices.
        applications: expected number of products with the operators.
        soft_modes: whether soft modes will be computed.
        can_condense: whether PETSc has MUMPS, which condenses subdomains; without it the default is sparse factors.
    """
    choices = []
    for size in sizes:
        n = size.boundary_dofs
        facewise = size.is_whole_body and n > thresholds.whole_boundary_dofs and not size.has_springs
        pays = DENSE_INVERSE_COST * n**3 <= size.dofs * applications
        is_useful = pays or size.has_springs or (soft_modes and not facewise)
        possible = n <= thresholds.dense_boundary_dofs and can_condense
        explicit = kind == "explicit" or (kind == "auto" and is_useful and possible)
        choices.append(OperatorChoice(explicit and n > 0, facewise))
    return choices
