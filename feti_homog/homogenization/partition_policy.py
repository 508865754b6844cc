"""Number of pieces that a cell is cut into: from the case, else the fastest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.case.case import Case
from feti_homog.feti.decomposition.partition import pieces_for_count, pieces_for_size
from feti_homog.homogenization import phase_laws
from feti_homog.materials.laws import isotropic_ratio
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.tiles.tiles import DEFAULT_TILES, TilePolicy
from feti_homog.system.petsc.option_table import only_prints
from feti_homog.system.petsc.options import given_options
from feti_homog.typing import Int

# Poisson's ratio up to which single nodes of mixed elements are hardly stiffer than mu makes them (`SCALED_LAME`).
MOST_POISSON = 0.45
# Ratio of stiffnesses up to which subdomains may have several phases: above, rounding in their dense matrices costs
# accuracy (4e-7 at 1e6, 2e-10 at 9e3) and then convergence.
MOST_CONTRAST = 1e3
# Options that only set how exact the solver is: others that choose ask for a dual problem, which one subdomain has not.
TOLERANCES = {"feti_ksp_rtol", "feti_ksp_atol", "feti_ksp_max_it"}


@dataclass(frozen=True)
class PartitionPolicy:
    """Into how many pieces the mesh and bodies are cut by default; sizes in degrees of freedom after refinement.

    Attributes:
        piece_dofs: of a piece; with smaller pieces the coarse problem takes longer, with larger ones the factors and
            the dense matrices do.
        piece_boundary_dofs: of a piece on the boundary to other bodies, at most; for pieces of narrow bodies.
        cut_factor: a bonded body is cut if it is larger than a piece by this factor, or its boundary to other bodies is
            than that of a piece.
        even_cut_factor, even_share: instead of `cut_factor`, this one for bodies that are no more than this share of
            the load of a rank, for they can be distributed evenly as they are.
        breakable_boundary_dofs: where bonds may break, a body is cut only if its boundary has more: the cell is solved
            so often then that whole bodies pay as long as dense matrices of their boundaries are small.
        tiles: of the coarse mesh.
        across_dofs: where nothing can part, cells up to this size are cut across materials, not body by body.
        across_piece_dofs: of such a piece, which has no more multipliers than one of a body; so it may be larger.
        whole_dofs: such a cell on one rank is not cut up to this size: one sparse factor takes less time than the dense
            matrices of pieces do, and twice their memory.
        whole_ranks: on up to so many ranks each has one piece of such a cell, whose Schur complements are factored
            together; they are too large for more ranks.
        strip_dofs: cells from this size on are halved into strips: below, boundaries are short anyway, and estimates of
            errors, which leave boundaries as they are, depend less on the direction of METIS' cuts.

    `scripts/benchmark scripts/cases/benchmark_1m.toml --tools feti` times the bonded ones, `scripts/benchmark_path`
    those of bodies that may part, and `scripts/benchmark --table small` the last five.
    """

    piece_dofs: int = 2200
    piece_boundary_dofs: int = 500
    cut_factor: float = 2.5
    even_cut_factor: float = 16.0
    even_share: float = 1 / 16
    breakable_boundary_dofs: int = 2500
    tiles: TilePolicy = DEFAULT_TILES
    across_dofs: int = 0
    across_piece_dofs: int = 7000
    whole_dofs: int = 400_000
    whole_ranks: int = 2
    strip_dofs: int = 30_000

    def across_pieces(self, dofs: int, n_ranks: int) -> int:
        """Return into how many pieces a cell in which nothing can part is cut across materials; 0 for body by body.

        As many for each rank.
        """
        if dofs > self.across_dofs:
            return 0
        if n_ranks <= self.whole_ranks and dofs <= self.whole_dofs:
            return n_ranks
        return n_ranks * max(1, round(dofs / (n_ranks * self.across_piece_dofs)))


DEFAULT_POLICY = PartitionPolicy()
# What runs of cases take: at most this many degrees of freedom are cheaper across materials.
BY_COST = PartitionPolicy(across_dofs=400_000)


def can_be_cut_across(case: Case) -> bool:
    """Return whether subdomains may reach across materials: nothing parts, and the case leaves the cut to the program.

    The scaling of jumps in nearly incompressible phases and between phases of very different stiffness is of bodies.
    Options of the dual solver are for the subdomains that it is known for.
    """
    asked, free = case.decomposition, ("auto", None, None, "torus")
    if case.interfaces or (asked.cut, asked.subdomains, asked.max_dofs, case.cell.bodies) != free:
        return False
    given = {*case.petsc, *given_options()} - TOLERANCES
    if any(name.startswith("feti_") and not only_prints(name) for name in given):
        return False
    ratios = (isotropic_ratio(material) or 0.0 for material in case.materials.values())
    return max(ratios) <= MOST_POISSON and _contrast(case) <= MOST_CONTRAST


def _contrast(case: Case) -> float:
    """Return the largest ratio of the largest entries of two phases' stiffnesses to strains, in any problem."""
    law_kinds = (phase_laws.plane_law, phase_laws.axial_law)[: len(phase_laws.problems(case))]
    sizes = np.array([[np.abs(law(case, phase)[:4, :4]).max() for phase in case.materials] for law in law_kinds])
    return float((sizes.max(axis=1) / sizes.min(axis=1)).max())


def wanted_pieces(
    case: Case,
    load: Int,
    edges: Int,
    lattice: ReferenceLattice,
    n_ranks: int,
    policy: PartitionPolicy = DEFAULT_POLICY,
) -> Int:
    """(b,) wanted pieces of each body, from the case, else from the policy; at least one for each rank.

    Args:
        load: (b,) coarse triangles of each body.
        edges: (b,) coarse edges that each body shares with others.
    """
    # A coarse triangle brings about M^2 / 2 nodes.
    dofs_of_triangle = lattice.intervals**2
    if case.decomposition.max_dofs is not None:
        return pieces_for_size(load, dofs_of_triangle, case.decomposition.max_dofs)
    if case.decomposition.subdomains is not None:
        return pieces_for_count(load, case.decomposition.subdomains)
    all_dofs = int(load.sum()) * dofs_of_triangle
    boundary = edges * 2 * lattice.intervals
    if case.interface is None:
        evenly_shared = min(policy.even_cut_factor * policy.piece_dofs, policy.even_share * all_dofs / n_ranks)
        largest = max(policy.cut_factor * policy.piece_dofs, evenly_shared)
        to_cut = (load * dofs_of_triangle > largest) | (boundary > policy.cut_factor * policy.piece_boundary_dofs)
    else:
        to_cut = boundary > policy.breakable_boundary_dofs
    by_size = pieces_for_size(load, dofs_of_triangle, policy.piece_dofs)
    by_boundary = np.minimum(-(-boundary // policy.piece_boundary_dofs), load)
    pieces = np.where(to_cut, np.maximum(by_size, by_boundary), 1)
    return pieces if pieces.sum() >= n_ranks else pieces_for_count(load, n_ranks)
