"""The parts of the solver that the options ask for: boundary operators, preconditioner, coarse problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.feti.coarse.adaptive import THRESHOLD, AdaptiveCoarseSpace
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators.choice import KINDS
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import shared_dofs
from feti_homog.feti.preconditioners.influence import Influence
from feti_homog.feti.preconditioners.scaled import Dirichlet, Identity, Lumped, Preconditioner
from feti_homog.feti.thresholds import DEFAULTS, Thresholds

COARSE_SPACES = ("auto", "natural", "adaptive")
PRECONDITIONERS = ("auto", "none", "lumped", "dirichlet", "influence")
# Applications of the dual operator from which on influence pays, the largest bonded cell to factor for it, and the
# most nodes that may be debonded from the start.
MANY, LARGEST_BONDED, MOST_PRECRACKED = 1000, 40_000, 500


def parts(
    comm: MPI.Intracomm,
    jump_operator: JumpOperator,
    subdomains: Sequence[Subdomain],
    applications: int,
    thresholds: Thresholds = DEFAULTS,
) -> tuple[InterfaceOperators, Preconditioner, NaturalCoarseSpace]:
    """What the options `feti_dual_operator`, `feti_pc_type` and `feti_coarse_*` name.  Collective.

    Raises:
        CaseError: an option has no such value, or two exclude each other.
    """
    pc = _choice("pc_type", PRECONDITIONERS, "auto")
    operator = _choice("dual_operator", KINDS, "explicit" if pc == "influence" else "auto")
    space = _choice("coarse_space", COARSE_SPACES, "auto")
    threshold = PETSc.Options("feti_").getReal("coarse_threshold", THRESHOLD)
    soft = space == "adaptive" or (space == "auto" and _cut(comm, subdomains))
    boundary = InterfaceOperators(jump_operator, subdomains, operator, applications, soft, thresholds)
    condensed = [isinstance(o, ExplicitInterfaceOperator) for o in boundary.operators]
    dense = comm.allreduce(all(condensed), MPI.LAND)
    examinable = comm.allreduce(all(np.logical_or(condensed, boundary.facewise)), MPI.LAND)
    if pc == "influence" and not dense:
        raise CaseError("-feti_pc_type influence: needs -feti_dual_operator explicit")
    if pc == "auto":
        pays = applications >= MANY and space != "adaptive" and dense and _fits(comm, jump_operator)
        pc = "influence" if pays else "dirichlet"
    if space == "adaptive" and not (examinable and pc == "dirichlet"):
        raise CaseError("-feti_coarse_space adaptive: needs -feti_pc_type dirichlet, -feti_dual_operator not implicit")
    preconditioner = _preconditioner(pc, comm, jump_operator, boundary)
    if soft and examinable and isinstance(preconditioner, Dirichlet):
        replicated = thresholds.replicated_vectors
        coarse = AdaptiveCoarseSpace(comm, jump_operator, boundary, preconditioner, threshold, replicated)
        return boundary, preconditioner, coarse
    return boundary, preconditioner, NaturalCoarseSpace(comm, jump_operator, boundary)


def _preconditioner(
    kind: str, comm: MPI.Intracomm, jump_operator: JumpOperator, boundary: InterfaceOperators
) -> Preconditioner:
    if kind == "none":
        return Identity()
    if kind == "influence":
        return Influence(comm, jump_operator, boundary)
    return (Lumped if kind == "lumped" else Dirichlet)(comm, jump_operator, boundary)


def _fits(comm: MPI.Intracomm, jump_operator: JumpOperator) -> bool:
    """Whether the bonded cell can be factored, and few enough nodes are debonded from the start; collective."""
    precracked = comm.allreduce(int(jump_operator.nodes.precracked.sum()))
    return shared_dofs(comm, jump_operator) <= LARGEST_BONDED and precracked <= MOST_PRECRACKED


def _cut(comm: MPI.Intracomm, subdomains: Sequence[Subdomain]) -> bool:
    """Whether bodies are cut into pieces: the webs that METIS makes of a matrix have soft modes."""
    bodies = comm.allreduce(max((s.submesh.body for s in subdomains), default=-1), MPI.MAX) + 1
    return bool(comm.allreduce(len(subdomains)) > bodies)


def _choice(name: str, known: Sequence[str], default: str) -> str:
    """The value of the option -feti_`name`."""
    value = PETSc.Options("feti_").getString(name, default)
    if value not in known:
        raise CaseError(f"-feti_{name} {value}: expected one of {', '.join(known)}")
    return str(value)
