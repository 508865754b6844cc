"""Envelopes of small cells, and the onsets of paths in the same cells."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from petsc4py import PETSc

from feti_homog import run
from feti_homog.analysis.tip_records import criterion_of
from feti_homog.homogenization import unit_cell
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import OPEN
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress
from support import cases, torn_cells
from support.loads import strains
from support.ranks import PIECES

TIGHT = {"feti_ksp_rtol": 1e-12}
MAX = {"normal_strength": 3.0, "tangential_strength": 2.0}
QUADRATIC = MAX | {"criterion": "quadratic"}
ENERGY = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0, "criterion": "energy", "toughness": 0.005}


def case_of(plane: str, interface: dict[str, Any], folder: Path = Path(), **sections: dict[str, Any]) -> Any:
    """Return a case of a small cell with the interface; `sections` replace its other sections."""
    base = {
        "cell": {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.2},
        "output": {"fields": False, "pictures": False},
        "petsc": TIGHT,
        "decomposition": PIECES,
    }
    return cases.case_of(folder=folder, plane=plane, interface=interface, **base | sections)


def envelope(
    comm: Any,
    plane: str,
    interface: dict[str, Any],
    axes: Sequence[str],
    sections: dict[str, Any] | None = None,
    folder: Path = Path(),
    **own: Any,
) -> Any:
    """Return the result of an envelope. Collective."""
    return run(case_of(plane, interface, folder, envelope={"plane": list(axes)} | own, **sections or {}), comm)


@contextmanager
def torn(comm: Any, plane: str, interface: dict[str, Any], **sections: Any) -> Iterator[Any]:
    """Provide the torn cell of a path, in generalized plane strain of an envelope, in the cell of `envelope`.

    Collective.
    """
    PETSc.garbage_cleanup(comm)
    if plane == "generalized":
        sections["envelope"] = {"plane": ["E11", "E22"]}
    else:
        sections["path"] = {"strain": [1.0, 0.0, 0.0]}
    case = case_of(plane, interface, **sections)
    with case_options(case.petsc):
        cell = unit_cell.tear(case, comm, Progress(comm, quiet=True))
        yield cell
        cell.destroy()


def path_onset(cell: Any, strain: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the factor of `strain` at which the first bond of a path breaks, and the stress there.  Collective."""
    contact = cell.case.interface.contact
    interface = torn_cells.interface(cell, contact)
    status = np.where(cell.debonded(None), OPEN, 0).astype(np.int8)
    far = 1e6 * strain
    point = next(
        events(
            CoupledInterfaces(interface),
            criterion_of(cell),
            strains(far[None]),
            unloaded(CoupledInterfaces(interface), torn_cells.bonds(status)),
        )
    )
    assert point.broke or cell.comm.allreduce(point.broke)
    return 1e6 * point.load_factor, point.scale * interface.stress(point.state.solution)
