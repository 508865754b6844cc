"""Macroscopic response of the torn cell, and the laws that every response must obey.

Voigt order [11, 22, 12] with engineering shear; stresses in the unit of the moduli.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.errors import ConvergenceError
from feti_homog.feti.solver import DualSolution
from feti_homog.progress import Progress
from feti_homog.torn import TornCell

Float = NDArray[np.float64]

CASES = ("E11", "E22", "G12")


@dataclass(frozen=True)
class Response:
    """The cell under one macroscopic strain.

    Attributes:
        strain: (3,) E.
        stress: (3,) Sigma = <sigma>.
        solution: multipliers, jumps and amplitudes.
        u: (local dofs,) fluctuating displacement u*, this rank's subdomains one after the other.
        checks: relative errors of the laws: `strain` <eps> = E, Eq. (3); `hill` <sigma:eps> = Sigma:E,
            Eq. (8); `jump`, the largest opening of a glued node relative to the largest displacement.
    """

    strain: Float
    stress: Float
    solution: DualSolution
    u: Float
    checks: dict[str, float]


def respond(cell: TornCell, strain: Float, start: Float) -> Response:
    """Solve the unit-cell problem under the macroscopic `strain` and average; `start` are first multipliers.

    Collective.

    Raises:
        ConvergenceError: the solve broke down and left no numbers.
    """
    solver = cell.solver
    solution = solver.solve(strain, start)
    if not np.isfinite(solution.residual):
        raise ConvergenceError(
            f"strain {strain.tolist()}: the Krylov method broke down after {solution.iterations} iterations "
            f"(KSPConvergedReason {solution.reason})"
        )
    u = solver.displacement(solution)
    means = _averages(cell, strain, u) / cell.plan.area
    stress, star, energy = means[:3], means[3:6], means[6]
    checks = {
        "strain": float(np.abs(star).max() / np.abs(strain).max()),
        "hill": float(abs(energy - stress @ strain) / abs(energy)),
        "jump": _largest(cell, solver.active.mask * solution.jump)
        / _largest(cell, displacement(cell, strain, u)),
    }
    return Response(strain, stress, solution, u, checks)


def effective_stiffness(cell: TornCell, progress: Progress) -> tuple[Float, list[Response]]:
    """L^ef, whose columns are the stresses under the unit strains (39), and those three responses."""
    responses = []
    for name, strain in zip(progress.bar(CASES, "load cases"), np.eye(3), strict=True):
        response = respond(cell, strain, np.zeros(cell.solver.rows))
        solution = response.solution
        progress.say(f"  {name}: {solution.iterations} iterations, relative jump {solution.residual:.1e}")
        responses.append(response)
    return np.stack([r.stress for r in responses], axis=1), responses


def asymmetry(L: Float) -> float:
    """max |L - L^T| / max |L|."""
    return float(np.abs(L - L.T).max() / np.abs(L).max())


def displacement(cell: TornCell, strain: Float, u: Float) -> Float:
    """(nodes, 2) total displacement E y + u*, Eq. (14), at this rank's plane nodes."""
    E = np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
    points = np.concatenate([s.mesh.points for s in cell.subdomains] or [np.zeros((0, 2))])
    return points @ E + fluctuation(cell, u)


def fluctuation(cell: TornCell, u: Float) -> Float:
    """(nodes, 2) u* at this rank's plane nodes."""
    parts = zip(cell.subdomains, cell.offsets, strict=False)
    own = [u[o : o + len(s.Q)].reshape(-1, 2)[s.mesh.node_class] for s, o in parts]
    return np.concatenate(own or [np.zeros((0, 2))])


def _averages(cell: TornCell, E: Float, u: Float) -> Float:
    """(7,) integrals over the cell of sigma, eps* and sigma:eps; collective."""
    total = np.zeros(7)
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)]
        from_u = s.Q.T @ own
        total[:3] += s.area * s.L @ E + from_u
        total[3:6] += np.linalg.solve(s.L, from_u)
        total[6] += s.area * E @ s.L @ E + 2 * E @ from_u + own @ (s.K @ own)
    cell.comm.Allreduce(MPI.IN_PLACE, total)
    return total


def _largest(cell: TornCell, values: Float) -> float:
    """max |values| over all ranks."""
    return float(cell.comm.allreduce(np.abs(values).max(initial=0.0), MPI.MAX))
