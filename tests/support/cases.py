"""Cases for the tests, and the program's stages run on them without files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from petsc4py import PETSc
from reference import monolithic

from feti_homog.analysis import stiffness
from feti_homog.analysis.context import AnalysisContext, CellLoads
from feti_homog.case import cases
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.homogenization.partition_policy import DEFAULT_POLICY
from feti_homog.homogenization.unit_cell import tear
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

MATRIX, FIBRE = {"young": 88.0, "poisson": 0.299}, {"young": 200.0, "poisson": 0.222}


def make_case(
    *, matrix=MATRIX, fibre=FIBRE, plane="strain", petsc=None, decomposition=None, output=None, folder=".", **cell
):
    """Return a case of the given cell, tight enough (1e-10) for comparisons."""
    circular = {} if cell.get("geometry") == "mesh" else {"fibre_fraction": 0.4, "mesh_size": 0.15}
    document = {
        "cell": {"geometry": "hexagonal"} | circular | cell,
        "material": {"matrix": matrix, "fibre": fibre},
        "analysis": {"type": "stiffness", "plane": plane},
        "petsc": {"feti_ksp_rtol": 1e-10} | (petsc or {}),
        "decomposition": decomposition or {},
        "output": output or {},
    }
    return cases.parse(document, Path(folder))


def case_of(cell, folder=".", plane="strain", **sections):
    """Return a case of this cell section, with other sections, unless None, in place of the usual ones.

    The section of an analysis, such as `path`, chooses it; without one it is the stiffness.
    """
    sections = {name: section for name, section in sections.items() if section is not None}
    kinds = [name for name in ("path", "load", "angle", "envelope") if name in sections]
    document = {
        "cell": cell,
        "material": {"matrix": MATRIX, "fibre": FIBRE},
        "analysis": {"type": (kinds or ["stiffness"])[0], "plane": plane},
        "petsc": {"feti_ksp_rtol": 1e-11},
        "output": {"pictures": False},
    }
    return cases.parse(document | sections, Path(folder))


class Responses:
    """Takes the responses that are to be kept as states, in place of `StateRecorder`."""

    is_recording = False

    def __init__(self):
        self.taken = []

    def record(self, states, *_):
        self.taken += [plane for plane, *_ in states.values()]


def solve(case, comm, thresholds=DEFAULTS, policy=DEFAULT_POLICY):
    """Return the torn cell, L^ef and the responses."""
    PETSc.garbage_cleanup(comm)
    progress = Progress(comm, quiet=True)
    with case_options(case.petsc):
        cell = tear(case, comm, progress, thresholds, policy)
        context, states = AnalysisContext.of(cell, progress), Responses()
        context = replace(context, loads=CellLoads(cell, contact=False), states=states)
        return cell, stiffness.run(context)["effective_stiffness"], states.taken


def monolithic_stiffness(cell):
    """L^ef of the same refined mesh by one monolithic solve, on every rank."""
    parts = cell.comm.gather([(p.mesh.points, p.mesh.triangles, p.L, p.is_mixed) for p in cell.parts])
    result = None
    if cell.comm.rank == 0:
        own = [part for parts_of_rank in parts for part in parts_of_rank]
        first = np.cumsum([0] + [len(points) for points, *_ in own])
        result = monolithic.effective_stiffness(
            np.concatenate([points for points, *_ in own]),
            np.concatenate([triangles + n for (_, triangles, *_), n in zip(own, first, strict=False)]),
            np.concatenate([np.broadcast_to(L, (len(triangles), 3, 3)) for _, triangles, L, _ in own]),
            cell.summary.width,
            cell.summary.height,
            np.concatenate([np.full(len(triangles), is_mixed) for _, triangles, _, is_mixed in own]),
        )
    return cell.comm.bcast(result)


def relative_error(L, expected):
    """Largest difference of entries, relative to the largest entry."""
    return np.abs(L - expected).max() / np.abs(expected).max()
