"""Define the records in result.json for the cell, fibres, solver, checks, bounds, sensitivities and phase stresses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.materials import phase_bounds
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.system.runtime import described, records
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.case import Case
    from feti_homog.homogenization import domain_partition, unit_cell


@dataclass(frozen=True)
class CellInfo:
    """The sizes, phase fractions and mesh of the cell."""

    width: float = described("width of the cell", records.LENGTH)
    height: float = described("height of the cell", records.LENGTH)
    area: float = described("area of the cell", f"{records.LENGTH} squared")
    fibre_fraction: float = described("share of all phases but matrix and coating in the area of the cell")
    fractions: Mapping[str, float] = described("area share of each phase", entries={"PHASE": "share of one phase"})
    elements: int = described("triangles of the refined mesh")
    nodes: int = described("nodes of the refined mesh, once for each body in each subdomain: depends on ranks")
    mesh_size: float | None = described(
        "size of the elements before refinement / width, from the case or chosen by `accuracy`; absent for a user's "
        "mesh",
        default=None,
    )
    refine: int = described("how many times elements were split in four, from the case or by `accuracy`", default=0)
    porosity: float = described("share of voids in the area of the cell", default=0.0)
    origin: tuple[float, float] = described("lower left corner of the cell", records.LENGTH, default=(0.0, 0.0))
    match_distance: float | None = described(
        "for a cell that matches a table: root mean square difference of the sorted distances of nearest and second "
        "neighbours, in mean diameters",
        default=None,
    )


@dataclass(frozen=True, kw_only=True)
class FibreInfo:
    """One fibre: number N (for `fibre = N` in case files), phase, shape and bond strength."""

    number: int = described("number in `fibre = N` of case files, from 1")
    row: int | None = described("line in the fibre table, or position in `fibre_list`, from 1", default=None)
    phase: str = described("name of its phase")
    centre: Float | None = described(
        "centre of its circle or area, at the periodic image that a table lists; absent if it winds around the cell",
        records.LENGTH,
        "(2,)",
        default=None,
    )
    radius: float | None = described("radius of its circle; absent if it is not round", records.LENGTH, default=None)
    semi_axes: Float | None = described("semi-axes, only of an ellipse", records.LENGTH, "(2,)", default=None)
    angle: float | None = described("angle from x1 to the first semi-axis of an ellipse", records.DEGREES, default=None)
    coating: float | None = described("thickness of its coating, if any", records.LENGTH, default=None)
    strength: float | None = described(
        "strength of its bonds / strength in [interface]; absent if all fibres have the same strength", default=None
    )

    def __str__(self) -> str:
        place = "around the cell" if self.centre is None else "centre ({:.6g}, {:.6g})".format(*self.centre)
        return f"{self.number} ({self.phase}{f', row {self.row}' if self.row else ''}, {place})"

    @classmethod
    def all_of(cls, case: Case, summary: domain_partition.CellSummary, factors: Float) -> tuple[FibreInfo, ...]:
        """Build the records of all fibres of a cell, in the order of their numbers.

        `factors` (fibres,) are the strength factors of their bonds.  Centres are in the user's coordinates.
        """
        bodies, varies = summary.fibre_bodies, not (factors == 1.0).all()
        ellipses = Ellipses(summary.centres, summary.frames)
        is_ellipse = np.isnan(summary.radii) & ~np.isnan(ellipses.angles)
        centres, table, rows = summary.centres[bodies] + summary.origin, case.cell.table, [None] * summary.fibres
        if table is not None:
            from feti_homog.microstructure import periodic_table  # imports the windows of tables

            rows = table.row[periodic_table.fibre_rows(table, case.cell.window)].tolist()
            centres = periodic_table.listed_centres(table, case.cell.window, centres)
        columns = bodies, summary.coatings, factors, centres, rows
        return tuple(
            cls(
                number=number,
                phase=summary.phases[summary.constituent_phase[body]],
                row=row,
                centre=None if np.isnan(centre[0]) else centre,
                radius=None if np.isnan(summary.radii[body]) else float(summary.radii[body]),
                semi_axes=ellipses.semi_axes[body] if is_ellipse[body] else None,
                angle=float(ellipses.angles[body]) if is_ellipse[body] else None,
                coating=float(thickness) if thickness > 0 else None,
                strength=float(factor) if varies else None,
            )
            for number, (body, thickness, factor, centre, row) in enumerate(zip(*columns, strict=True), 1)
        )


@dataclass(frozen=True)
class SolverInfo:
    """Sizes, iterations and convergence of the dual problems of a cell."""

    ranks: int = described("MPI ranks")
    bodies: int = described("number of bodies: the matrix and the fibres")
    subdomains: int = described("subdomains that the bodies are cut into")
    dofs: int = described("degrees of freedom of all subdomains")
    multipliers: int = described("Lagrange multipliers of the dual problem")
    interface_nodes: int = described("nodes of the fibre-matrix interfaces; periodic images count once")
    kernel_dim: int = described("rigid-body motions of all subdomains")
    coarse_dim: int = described("vectors of the coarse space, rigid-body motions included")
    factorizations: int = described("subdomains that were factored, each once")
    coarse_factorizations: int = described("factorizations of the coarse problem")
    rtol: float = described("relative tolerance of the dual problem")
    solves: int = described("dual problems solved")
    iterations: tuple[int, ...] = described("Krylov iterations of each state")
    converged_reason: tuple[int, ...] = described("PETSc's KSPConvergedReason of each state, negative if it failed")
    method: str | None = described("how the cell is cut, and by which preconditioner it is solved", default=None)
    condition: float | None = described(
        "largest condition number of the projected, preconditioned dual operator, estimated by the iterations",
        default=None,
    )
    options: Mapping[str, str] | None = described(
        "solver options that change more than the output", entries={"OPTION": "its value, or empty"}, default=None
    )

    @classmethod
    def of(cls, cell: unit_cell.TornCell, iterations: Sequence[int], reasons: Sequence[int]) -> SolverInfo:
        """Build the record of all problems of a cell, without `options`.  Collective.

        `iterations` and `reasons` (KSPConvergedReason) have an entry for each state.
        """
        summary, solvers = cell.summary, [problem.solver for problem in cell.problems]
        cut = "pieces across the materials, for nothing can part" if summary.across else "bodies and pieces of bodies"
        uncut = "one subdomain, for nothing can part: one factor of the whole cell"
        return cls(
            ranks=cell.comm.size,
            bodies=summary.bodies,
            subdomains=summary.subdomains,
            dofs=cell.comm.allreduce(sum(s.n_dofs for solver in solvers for s in solver.subdomains)),
            multipliers=sum(s.jump_operator.global_rows for s in solvers),
            interface_nodes=summary.interface_nodes or cell.comm.allreduce(len(cell.solver.jump_operator.nodes.row)),
            kernel_dim=sum(s.natural.kernel_dimension for s in solvers),
            coarse_dim=sum(s.coarse_dimension for s in solvers),
            factorizations=cell.comm.allreduce(sum(len(s.interface_operators.operators) for s in solvers)),
            coarse_factorizations=sum(s.natural.factorizations for s in solvers),
            method=f"{cut}: {cell.solver.method}" if cell.solver.jump_operator.global_rows else uncut,
            condition=max(s.condition for s in solvers) or None,
            rtol=cell.solver.rtol,
            solves=sum(s.solves for s in solvers),
            iterations=tuple(iterations),
            converged_reason=tuple(reasons),
        )


@dataclass(frozen=True)
class Checks:
    """The largest relative error of each law (strain, Hill, jump, contact, ...) over all states."""

    strain: float = described("mean strain, with the opening of debonded faces, equals E")
    hill: float = described("Hill's lemma: mean of stress times strain equals Sigma E")
    jump: float | None = described(
        "no jump where faces are glued, relative to the largest displacement; absent if the cell is one subdomain",
        default=None,
    )
    stress: float | None = described("prescribed stresses are met, relative to stress or stiffness", default=None)
    kkt_complementarity: float | None = described("contact: traction times gap vanishes", default=None)
    kkt_penetration: float | None = described("contact: no gap is negative", default=None)
    kkt_tension: float | None = described("contact: no closed node is pulled", default=None)
    kkt_friction: float | None = described(
        "friction: shear on sticking faces is at most mu p, on sliding faces mu p against the slip, and along the "
        "fibres 0",
        default=None,
    )
    symmetry: float | None = described("L^ef is symmetric; absent if debonded faces may touch", default=None)


@dataclass(frozen=True)
class StiffnessBounds:
    """Bounds on the effective stiffness L^ef from phase stiffnesses and fractions, for any arrangement."""

    voigt: Float = described("upper bound of the stiffness: uniform strain", records.STRESS, "(3, 3)")
    reuss: Float = described("lower bound of the stiffness: uniform stress", records.STRESS, "(3, 3)")
    hashin_shtrikman: phase_bounds.Bounds | None = described("isotropic bounds; null if a phase is not isotropic")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivities:
    """Derivatives of n results of a cell with respect to p constants of its case file, at fixed geometry."""

    parameters: tuple[str, ...] = described("constants of the case, such as `material.fibre.young`")
    parameter_values: Float = described("their values, each in its unit", "", "(p,)")
    constants: tuple[str, ...] = described(
        "entries `C11`, ... of the stiffness, moduli and ratios `E1`, ..., `thermal_S11`, ..., `expansion_x1`, ...; "
        "of a load: the strains and stresses that it does not prescribe, and `stored`"
    )
    constant_values: Float = described("their values, each in its unit", "", "(n,)")
    derivatives: Float = described("derivative of each constant with respect to each parameter", "", "(n, p)")
    at_fixed_status: bool = described(
        "whether faces touch without tension: derivatives hold as long as no node opens or closes", default=False
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseStresses:
    """The largest stresses of one phase, over its integration points, in each of s states."""

    phase: str = described("name of the phase")
    state: tuple[str, ...] = described("labels of the states, as in result.h5: `E11`, `load`, `event 12`, ...")
    principal: Float = described("largest principal stress, tension positive", records.STRESS, "(s,)")
    principal_at: Float = described("its position in the cell", records.LENGTH, "(s, 2)")
    von_mises: Float = described("largest von Mises stress", records.STRESS, "(s,)")
    von_mises_at: Float = described("its position in the cell", records.LENGTH, "(s, 2)")
    hydrostatic: Float = described("largest hydrostatic stress, a third of the trace", records.STRESS, "(s,)")
    hydrostatic_at: Float = described("its position in the cell", records.LENGTH, "(s, 2)")
    criterion: str | None = described("criterion of the phase's `strength`", default=None)
    mode: tuple[str, ...] | None = described("governing mode in Hashin's criterion: `axial tension`, ...", default=None)
    utilisation: Float | None = described(
        "largest utilisation of the strength: 1 at failure, proportional to the stress", "", "(s,)", default=None
    )
    utilisation_at: Float | None = described("its position in the cell", records.LENGTH, "(s, 2)", default=None)
