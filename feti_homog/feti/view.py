"""What -feti_view prints."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.influence import Influence
from feti_homog.feti.preconditioners.scaled import Preconditioner


def setup(
    comm: MPI.Intracomm, boundary: InterfaceOperators, preconditioner: Preconditioner, coarse: NaturalCoarseSpace
) -> str:
    """Subdomains, their operators, the preconditioner and the coarse space; collective."""
    sizes = np.array([n for part in comm.allgather([len(d) for d in boundary.dofs]) for n in part])
    dense = comm.allreduce(sum(isinstance(o, ExplicitInterfaceOperator) for o in boundary.operators))
    lines = [
        f"FETI: {len(sizes)} subdomains, {dense} with dense boundary operators",
        f"  boundary dofs of a subdomain: {sizes.min()} to {sizes.max()}, mean {sizes.mean():.0f}",
        f"  kernels: {coarse.dimension} rigid-body modes",
    ]
    if isinstance(preconditioner, Influence):
        lines.append(f"  influence columns by the bonded cell, {preconditioner.bonded.size} dofs on its shared nodes")
    if isinstance(coarse, AdaptiveCoarseSpace):
        counts = np.array([n for part in comm.allgather(coarse.counts) for n in part])
        lines.append(
            f"  soft modes below {coarse.threshold:g}: {counts.sum()}, at most {counts.max()} of a subdomain, "
            f"mean {counts.mean():.2f}"
        )
        large = comm.allreduce(sum(boundary.facewise))
        lines += [f"  {large} examined face by face"] if large else []
    lines.append(f"  coarse dimension {coarse.vectors}, {coarse.vectors / len(sizes):.2f} a subdomain")
    return "\n".join(lines)


def solve(ksp: PETSc.KSP, load_cases: int) -> str:
    """Iterations and condition number of a solve, as the Krylov method estimates it."""
    iterations = ksp.getIterationNumber()
    words = f"FETI: {load_cases} load case{'s' * (load_cases > 1)}, {iterations} iterations"
    if not iterations or ksp.getType() not in (PETSc.KSP.Type.CG, PETSc.KSP.Type.GMRES, PETSc.KSP.Type.FGMRES):
        return words
    largest, smallest = ksp.computeExtremeSingularValues()
    return f"{words}, condition number about {largest / smallest:.3g} ({smallest:.3g} to {largest:.3g})"
