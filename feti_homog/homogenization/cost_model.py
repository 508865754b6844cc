"""What a case takes: seconds, memory, and how many ranks are worth while; estimates before anything is solved.

About linear in the degrees of freedom, for bodies are cut into pieces of one size.  The constants are those that
`.venv/bin/python scripts/measure_cost.py` prints, on a 2-core machine.  Times are good to a factor of about two, and
up to four times longer where elements are so coarse that most nodes of a piece lie on its boundary; a job's time limit
should leave room for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from feti_homog.config.case import Case

START_SECONDS = 1.2  # Python, MPI, PETSc and gmsh
MESH_SECONDS = 3.9e-5  # a coarse triangle, on rank 0
SETUP_SECONDS = 9.5e-6  # a degree of freedom: assembling and factoring
SUBDOMAIN_SECONDS = 5.2e-3  # a subdomain
APPLY_SECONDS = 8.8e-8  # a degree of freedom in one application of operator and preconditioner
BASE_BYTES = 2.1e8  # of a rank with nothing on it
DOF_BYTES = 6.7e2
DOFS_OF_A_RANK = 50_000  # fewer on a rank, and its waiting for others takes more than it saves
# Typical numbers, by which a case is estimated and its operators are chosen.
ITERATIONS_OF_A_SOLVE, SOLVES_OF_A_CONTACT, SOLVES_OF_A_PATH = 20, 3, 100


@dataclass(frozen=True)
class Estimate:
    """Seconds of the whole run, bytes of the rank that needs most, and the ranks that the case wants."""

    seconds: float
    memory: float
    ranks: int


def applications(case: Case) -> int:
    """About how many times the analysis applies the dual operator."""
    solves = 3
    if case.angle is not None:
        solves = len(case.angle.values) * (3 if case.angle.strain is None else 1)
    if case.path is not None:
        solves = SOLVES_OF_A_PATH
    contact = case.interface is not None and case.interface.contact
    return ITERATIONS_OF_A_SOLVE * solves * (SOLVES_OF_A_CONTACT if contact else 1)


def estimate(
    dofs: Sequence[int], subdomains: Sequence[int], coarse_triangles: int, bodies: int, applications: int
) -> Estimate:
    """Of a case with `dofs` and `subdomains` on each rank, which applies its dual operator so many times.

    More ranks than bodies would cut bodies, which costs iterations.
    """
    own = zip(dofs, subdomains, strict=True)
    slowest = max(n * (SETUP_SECONDS + applications * APPLY_SECONDS) + k * SUBDOMAIN_SECONDS for n, k in own)
    return Estimate(
        seconds=START_SECONDS + coarse_triangles * MESH_SECONDS + slowest,
        memory=BASE_BYTES + max(dofs) * DOF_BYTES,
        ranks=max(1, min(bodies, ceil(sum(dofs) / DOFS_OF_A_RANK))),
    )


def words(found: Estimate, n_ranks: int) -> list[str]:
    """An estimate for `n_ranks` ranks in two lines, each with a label of eleven columns."""
    size = found.memory / 2**20
    memory = f"{size:.0f} MiB" if size < 1000 else f"{size / 1024:.1f} GiB"
    noun = "rank" if n_ranks == 1 else "ranks"
    return [
        f"estimate   on {n_ranks} {noun} about {_rounded(found.seconds)}, {memory} on the largest, without pictures",
        f"ranks      {found.ranks} would suit it (one for {DOFS_OF_A_RANK} degrees of freedom, at most one a body)",
    ]


def _rounded(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
