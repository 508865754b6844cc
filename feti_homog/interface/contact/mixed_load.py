"""The dual problem under mixed loads: some strains follow from prescribed stresses.

With fixed active rows the response is linear: the solutions under the prescribed strains and under unit strains
superpose, with factors that meet the stresses.
"""

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.feti import DualSolution, FetiSolver
from feti_homog.interface.contact.load_scales import NEGLIGIBLE, LoadScales
from feti_homog.interface.loads import Load
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float


def solve(scales: LoadScales, load: Load, start: Float) -> DualSolution:
    """Solve the dual problem under a load, from multipliers `start` (owned rows,).  Collective.

    Strains stay zero where the stresses are noise.

    Raises:
        NotCarriedError: no stiffness resists the stresses.
    """
    solver = scales.solver
    if not (load.by_stress.any() and load.values.any()):
        return solver.solve(load.values, start)
    unknown = np.flatnonzero(load.by_stress)
    strains = np.vstack([np.where(load.by_stress, 0.0, load.values), np.eye(len(load.values))[unknown]])
    starts = np.column_stack([start, np.zeros((len(start), len(unknown)))])
    needed = slice(0 if strains[0].any() else 1, None)
    solutions = solver.solve_many(strains[needed], starts[:, needed])
    stresses = np.stack([solver.stress_integral(solution)[unknown] / scales.size.prod() for solution in solutions])
    deficit = load.values[unknown]
    if strains[0].any():
        deficit = deficit - stresses[0]
    imposed = scales.imposed_strain(strains[0])
    noise = scales.sign_noise * float((scales.roots[: len(imposed)] * imposed).max())
    # Roots of stiffnesses scale the strains, so that all strains have similar sizes.  Scaled stiffnesses below the
    # solver's error, and scaled stresses below `noise`, are zero.
    stiffness, roots = stresses[-len(unknown) :], scales.roots[unknown]
    eigenvalues, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2 * np.outer(roots, roots)))
    along, resists = vectors.T @ (deficit / roots), eigenvalues > scales.sign_noise
    largest = max(NEGLIGIBLE * np.abs(deficit / roots).max(), noise)
    is_carried = not np.abs(along[~resists]).max(initial=0.0) > largest
    answer = vectors[:, resists] @ (along[resists] / eigenvalues[resists]) / roots if is_carried else None
    # Rank 0 decides: where a stiffness nearly vanishes, rounding may differ from processor to processor.
    factors = solver.comm.bcast(answer)
    if factors is None:
        raise NotCarriedError("nothing in the cell carries the stresses of the load")
    factors = np.concatenate([np.ones(len(solutions) - len(unknown)), factors])
    return solver.jumps.superposed(solutions, factors, solver.d)


def unresisted(solver: FetiSolver, by_stress: Bool, voigt: Float) -> Bool:
    """Mark the strains (v,) of prescribed stresses that contribute to a strain without stiffness.  Collective.

    Such a strain only opens debonded faces: rigid motions close the jumps of the torn cell, and the torn bodies bear no
    stress.  `voigt` (v, v) is the stress integral of clamped bodies.
    """
    unknown, undetermined = np.flatnonzero(by_stress), np.zeros(len(by_stress), bool)
    torn = solver.d[:, unknown]
    opened = solver.natural.project(solver.active.restrict(torn))
    sizes, open_jumps = (distributed_arrays.allreduce_sum(solver.comm, jumps.T @ jumps) for jumps in (torn, opened))
    largest = np.array([np.diag(sizes), np.abs(voigt[unknown, unknown])])
    scales = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    pairs = zip((open_jumps, solver.torn_stiffness[np.ix_(unknown, unknown)]), scales, strict=True)
    values, vectors = np.linalg.eigh(sum(matrix / np.outer(scale, scale) for matrix, scale in pairs))
    # The eigenvalues are squares of sizes.
    undetermined[unknown] = (np.abs(vectors[:, values < NEGLIGIBLE**2]) > NEGLIGIBLE).any(axis=1)
    return np.asarray(solver.comm.bcast(undetermined))
