"""What -feti_view prints."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.feti.factory import SolverParts
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.preconditioners.influence import Influence

ESTIMATES_SINGULAR_VALUES = (PETSc.KSP.Type.CG, PETSc.KSP.Type.GMRES, PETSc.KSP.Type.FGMRES)


def describe_setup(comm: MPI.Intracomm, parts: SolverParts) -> str:
    """Subdomains, their operators, the preconditioner and the coarse space; collective."""
    operators, preconditioner, adaptive = parts.operators, parts.preconditioner, parts.adaptive
    sizes = np.array([n for part in comm.allgather([len(d) for d in operators.dofs]) for n in part])
    dense = comm.allreduce(sum(isinstance(o, ExplicitInterfaceOperator) for o in operators.operators))
    lines = [
        f"FETI: {len(sizes)} subdomains, {dense} with dense boundary operators",
        f"  boundary dofs of a subdomain: {sizes.min()} to {sizes.max()}, mean {sizes.mean():.0f}",
        f"  kernels: {parts.natural.kernel_dimension} rigid-body modes",
    ]
    if isinstance(preconditioner, Influence):
        size = preconditioner.reference.assembled.size
        lines.append(f"  influence columns by the bonded cell, {size} dofs on its shared nodes")
    if adaptive is not None:
        counts = np.array([n for part in comm.allgather(adaptive.counts) for n in part])
        lines.append(
            f"  soft modes below {adaptive.threshold:g}: {counts.sum()}, at most {counts.max()} of a subdomain, "
            f"mean {counts.mean():.2f}"
        )
        facewise = comm.allreduce(sum(operators.facewise))
        lines += [f"  {facewise} examined face by face"] if facewise else []
    lines.append(f"  coarse dimension {parts.coarse_dimension}, {parts.coarse_dimension / len(sizes):.2f} a subdomain")
    return "\n".join(lines)


def describe_solve(ksp: PETSc.KSP, load_cases: int, iterations: int) -> str:
    """Iterations and condition number of a solve, as the Krylov method estimates it."""
    words = f"FETI: {load_cases} load case{'s' * (load_cases > 1)}, {iterations} iterations"
    if not iterations or ksp.getType() not in ESTIMATES_SINGULAR_VALUES:
        return words
    largest, smallest = ksp.computeExtremeSingularValues()
    return f"{words}, condition number about {largest / smallest:.3g} ({smallest:.3g} to {largest:.3g})"
