"""Choice of dense or sparse boundary operators, and of soft modes by faces or by whole boundaries.

A pure function of sizes: it needs no mesh and no MPI.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from feti_homog.feti.thresholds import DENSE_INVERSE_COST, Thresholds

KINDS = ("auto", "implicit", "explicit")


@dataclass(frozen=True)
class SubdomainSize:
    """Quantities that the choice depends on.

    Attributes:
        dofs: degrees of freedom of the subdomain.
        boundary_dofs: degrees of freedom that constraints act on.
        is_whole_body: whether each shared node of the subdomain belongs to one other body only.
        has_springs: whether springs hold the subdomain; its stiffness with springs is a dense matrix.
    """

    dofs: int
    boundary_dofs: int
    is_whole_body: bool
    has_springs: bool = False


@dataclass(frozen=True)
class OperatorChoice:
    """Choice for one subdomain.

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
    """Choose the boundary operators of each subdomain.

    Dense matrices pay if their inverse takes no longer than all applications of sparse factors.  Soft modes need dense
    matrices, except on large whole bodies, whose soft modes are computed face by face.

    Args:
        kind: of KINDS, the user's choice; `auto` leaves it to this function.
        applications: how many times the operators are expected to be applied.
        soft_modes: whether soft modes will be computed.
        can_condense: whether PETSc has MUMPS, which condenses subdomains to their boundaries.
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
