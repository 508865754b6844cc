"""Collect debonding tips for result.json, with energy release rates and modes; find bond law and critical bonds."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import TipRates, Tips
from feti_homog.errors import CaseError
from feti_homog.homogenization import averaging, energy_release, unit_cell
from feti_homog.interface.contact import BONDED
from feti_homog.interface.laws import UTILISATION_TIE, BondLaw, energy
from feti_homog.interface.path import path_points
from feti_homog.typing import Float, Int

# Decimals of directions in sorts: rounding differs from rank to rank, and must not change the order.
DIRECTION_DIGITS = 9


def criterion_of(cell: unit_cell.TornCell, grows: bool = False) -> BondLaw:
    """Return the bond law that decides on breaks along a path if `grows`, else on the first break.  Collective.

    With `growth = "released"`, released energies decide wherever tips may be: on a path, or at prescribed debonded
    faces.  Raises CaseError if they need the inverse dual operator, which only `-feti_pc_type influence` has.
    """
    law = cell.bond_law if grows else cell.bond_law.onset()
    if not (isinstance(law, energy.SpringEnergy) and cell.case.interfaces[0].growth == "released"):
        return law
    has_tips = grows or cell.comm.allreduce(int(cell.debonded(None).sum())) > 0
    if not has_tips or not cell.solver.jump_operator.global_rows:
        return law
    exact_inverses = [problem.solver.exact_inverse for problem in cell.problems]
    inverses = [inverse for inverse in exact_inverses if inverse is not None]
    if len(inverses) < len(cell.problems):
        raise CaseError('[interface] growth = "released": needs -feti_pc_type influence; or growth = "springs"')
    influence, *axial = inverses
    return energy.ReleasedEnergy(**vars(law), influence=influence, axial=next(iter(axial), None))


def tip_rates(context: AnalysisContext, responses: Mapping[str, Sequence[averaging.Response]]) -> TipRates:
    """Compute energy release rates at tips on circles under all loads but a unit temperature; note others.  Collective.

    `responses` maps a unit load to its only response, and any other load to a response for each problem.
    """
    rates = list[tuple[energy_release.EnergyRelease, str]]()
    for load, parts in responses.items():
        if parts[0].debonded and not load.endswith("temperature"):
            zones = [*zip(context.loads.problems, context.tip_zones, strict=True)]
            loaded = [(problem, zone) for problem, zone in zones if load.lstrip("-") in problem.loads] or zones
            pairs = zip(loaded, parts, strict=False)
            by_problem = [zone.release(part, problem.interface) for (problem, zone), part in pairs]
            modes = np.sum([rate.modes for rate in by_problem], axis=0)
            rates.append((replace(by_problem[0], modes=modes), load))
    names = ("fibre", "interface", "angle", "G", "G_I", "G_II", "G_III", "psi", "length")
    columns = [(r.fibre, r.pair, r.direction, r.total, *r.modes.T, r.mode_angle, r.length) for r, _ in rates]
    arrays = map(np.concatenate, zip(*columns, strict=True)) if rates else [np.zeros(0)] * len(names)
    table: dict[str, Any] = dict(zip(names, arrays, strict=True))
    table["load"] = tuple(load for rate, load in rates for _ in rate.fibre)
    table["fibre"] = tuple(table["fibre"].astype(int).tolist())
    table["interface"] = _sections(context.cell, table["interface"])
    table["G_III"] = table["G_III"] if context.cell.axial else None
    status, faces, cell = next(iter(responses.values()))[0].state.status, context.fibre_interfaces, context.cell.summary
    fibres = np.flatnonzero((faces.length(status != BONDED) > 0.0) & np.isnan(cell.radii[cell.fibre_bodies])) + 1
    if numbers := ", ".join(map(str, np.setdiff1d(fibres, faces.loose(status)))):
        context.notes.append(f"[interface] fibre {numbers}: no energy release rates at tips, which only circles have")
    return TipRates(**table)


def tips(context: AnalysisContext, law: BondLaw, point: path_points.Point) -> Tips:
    """Compute the tips at a path point, sorted by fibre, interface and direction.  Collective.

    A tip is an intact bond next to a broken bond.  Its utilisation sqrt(G / G_c(psi)) and mode tan^2 psi = G_II / G_I
    determine its energies per area G_I and G_II.
    """
    cell, loaded, bonds = context.cell, context.loads.interfaces, point.state.bonds
    traction = point.scale * loaded.traction(point.state.solutions)
    status = np.concatenate(cell.comm.allgather(bonds.status))
    is_next = (cell.neighbours.adjacency @ (status != BONDED) > 0)[cell.neighbours.first :][: len(bonds.status)]
    is_tip = (bonds.status == BONDED) & is_next
    node = np.flatnonzero(is_tip)
    used = point.scale * path_points.most_utilised(loaded, law, point.state)[0]
    driving = used[node] ** 2 * law.fracture(bonds, is_tip, traction)
    mode = law.at(node).mode_angle(traction[node])
    energies = driving * np.cos(mode) ** 2, driving * np.sin(mode) ** 2
    fibre, pair = cell.summary.numbers[loaded.nodes.fibre[node]], loaded.nodes.pair[node]
    local = np.column_stack([fibre, pair, bond_directions(cell)[node], *energies, np.degrees(mode)])
    table = np.concatenate(cell.comm.allgather(local))
    fibre, pair, direction, *_ = table.T
    order = np.lexsort((np.round(direction, DIRECTION_DIGITS), pair, fibre))
    fibre, pair, angle, opening, shear, psi = table[order].T
    return Tips(tuple(fibre.astype(int).tolist()), angle, opening, shear, psi, _sections(cell, pair))


def most_utilised_bond(context: AnalysisContext, law: BondLaw, point: path_points.Point) -> tuple[float, float]:
    """Return the fibre number, from 1, and the direction of the most utilised bond at a new path point.  Collective.

    Ties: lowest fibre, then direction (degrees).  Returns (NaN, NaN) if no bond carries more than the solver's error.
    """
    cell, sizes = context.cell, list[Float]()
    for problem, state in zip(context.loads.interfaces.problems, point.state.problems, strict=True):
        size = problem.scales.sign_noise * problem.scales.bond_stress(point.scale * state.asked)
        sizes += [size] * problem.solver.jump_operator.components
    used = np.where(point.used > law.share(np.stack(sizes, axis=1)), point.used, 0.0)
    largest = cell.comm.allreduce(used.max(initial=0.0), MPI.MAX)
    rows = np.flatnonzero((used > 0.0) & (used >= largest * (1.0 - UTILISATION_TIE)))
    fibre = cell.summary.numbers[context.loads.interfaces.nodes.fibre[rows]]
    table = np.concatenate(cell.comm.allgather(np.column_stack([fibre, bond_directions(cell)[rows]])))
    order = np.lexsort((np.round(table[:, 1], DIRECTION_DIGITS), table[:, 0]))
    return tuple(table[order[0]].tolist()) if len(table) else (np.nan, np.nan)


def _sections(cell: unit_cell.TornCell, pair: Float | Int) -> tuple[int, ...] | None:
    """Convert section indices `pair` to [[interface]] numbers from 1; None in cases with at most one section."""
    return tuple((pair + 1).astype(int).tolist()) if len(cell.case.interfaces) > 1 else None


def bond_directions(cell: unit_cell.TornCell) -> Float:
    """Return the directions (k,) of this rank's interface nodes from the centres of their fibres.

    Directions are in degrees in (-180, 180].  At a fibre without a centre, the direction of the normal stands in.
    """
    normal = cell.solver.jump_operator.nodes.normal
    of_normals = np.degrees(np.arctan2(normal[:, 1], normal[:, 0]))
    direction = np.where(np.isnan(cell.directions), of_normals, cell.directions)
    return np.asarray(direction + np.where(np.round(direction, DIRECTION_DIGITS) <= -180.0, 360.0, 0.0))
