"""The dual problem under strains of which some follow from given stresses.

With the active rows as they are the response is linear: the answer to the given strains and one to each unit of the
others are superposed such that the stresses are met.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver import FetiSolver
from feti_homog.interface.contact.load_scales import LoadScales
from feti_homog.interface.loads import Load
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Bool, Float

# Share of the stresses that may act on what resists nothing: rounding of directions.
UNCARRIED_SHARE = 1e-6
# Squares of jumps, and stresses, relative to those of the torn cell and of its bodies held, that are rounding.
UNRESISTED = 1e-12


def solve(scales: LoadScales, load: Load, start: Float) -> DualSolution:
    """Return the solution under a load, from the multipliers `start` (owned rows,) on.  Collective.

    Strains that meet no more than noise stay zero.

    Raises:
        NotCarriedError: nothing carries the stresses.
    """
    solver = scales.solver
    if not (load.by_stress.any() and load.values.any()):
        return solver.solve(load.values, start)
    unknown = np.flatnonzero(load.by_stress)
    strains = np.vstack([np.where(load.by_stress, 0.0, load.values), np.eye(len(load.values))[unknown]])
    starts = np.column_stack([start, np.zeros((len(start), len(unknown)))])
    needed = slice(0 if strains[0].any() else 1, None)
    found = solver.solve_many(strains[needed], starts[:, needed])
    stresses = np.stack([solver.stress_integral(each)[unknown] / scales.size.prod() for each in found])
    missing = load.values[unknown]
    if strains[0].any():
        missing = missing - stresses[0]
    imposed = scales.imposed_strain(strains[0])
    largest = scales.sign_noise * float((scales.roots[: len(imposed)] * imposed).max())
    # Rank 0 decides: rounding on other processors may part the ranks where a stiffness is nearly none.
    answer = _strains(stresses[-len(unknown) :], missing, scales.roots[unknown], scales.sign_noise, largest)
    factors = solver.comm.bcast(answer)
    if factors is None:
        raise NotCarriedError("nothing in the cell carries the stresses of the load")
    return superposed(solver, found, np.concatenate([np.ones(len(found) - len(unknown)), factors]))


def _strains(stiffness: Float, stress: Float, roots: Float, share: float, noise: float) -> Float | None:
    """(u,) strains that make the stresses (u,) by a stiffness (u, u) that may be singular; None if it carries them not.

    Each is scaled by the root (u,) of its own stiffness, so that none is small beside another.  Scaled stiffnesses of
    less than `share` and scaled stresses of less than `noise` are the solver's error.
    """
    eigenvalues, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2 * np.outer(roots, roots)))
    along, resists = vectors.T @ (stress / roots), eigenvalues > share
    largest = max(UNCARRIED_SHARE * np.abs(stress / roots).max(), noise)
    if np.abs(along[~resists]).max(initial=0.0) > largest:
        return None
    return np.asarray(vectors[:, resists] @ (along[resists] / eigenvalues[resists]) / roots)


def unresisted(solver: FetiSolver, by_stress: Bool, voigt: Float) -> Bool:
    """(v,) which of the strains with given stresses (v,) have a share in one that strains no body.  Collective.

    Such a strain opens faces without multipliers alone; `voigt` (v, v) is the stress integral of bodies that do not
    move.

    Of such a strain rigid motions close all jumps of the torn cell, and the torn bodies bear no stress.
    """
    unknown, found = np.flatnonzero(by_stress), np.zeros(len(by_stress), bool)
    torn = solver.d[:, unknown]
    left = solver.natural.project(solver.active.restrict(torn))
    sizes, open_jumps = (allreduce_sum(solver.comm, each.T @ each) for each in (torn, left))
    largest = np.array([np.diag(sizes), np.abs(voigt[unknown, unknown])])
    scales = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    pairs = zip((open_jumps, solver.torn_stiffness[np.ix_(unknown, unknown)]), scales, strict=True)
    values, vectors = np.linalg.eigh(sum(matrix / np.outer(scale, scale) for matrix, scale in pairs))
    shares = np.abs(vectors[:, values < UNRESISTED]) > UNCARRIED_SHARE
    found[unknown] = shares.any(axis=1)
    return np.asarray(solver.comm.bcast(found))


def superposed(solver: FetiSolver, solutions: Sequence[DualSolution], factors: Float) -> DualSolution:
    """Return the sum of solutions with the same active rows, each times its factor. Collective."""
    strain, lam, jump = (
        np.stack([getattr(each, name) for each in solutions], axis=1) @ factors for name in ("strain", "lam", "jump")
    )
    amplitudes = [each.alpha for each in solutions if each.alpha is not None]
    if len(amplitudes) < len(solutions):
        return replace(solutions[0], strain=strain, lam=lam, jump=jump, alpha=None)
    alpha = np.stack(amplitudes, axis=1) @ factors
    torn = solver.natural.project(solver.active.restrict(solver.d @ strain))
    pairs = np.stack([torn, solver.active.restrict(jump)])
    scale, left = np.sqrt(allreduce_sum(solver.comm, np.einsum("ij,ij->i", pairs, pairs)))
    return DualSolution(
        strain,
        lam,
        jump,
        alpha,
        max(each.iterations for each in solutions),
        min(each.reason for each in solutions),
        float(left / (scale or 1.0)),
        solutions[0].compliance,
    )
