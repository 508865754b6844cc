"""Mesh, interface and states of a result as arrays in memory: what result.h5 holds of this rank."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from feti_homog.results.field_layout import FibrePart, Header, InterfacePart, MeshPart, StatePart, tables

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

Part = TypeVar("Part", MeshPart, FibrePart, InterfacePart, StatePart)


@dataclass(frozen=True)
class Fields:
    """This rank's part of the fields; `gathered` has all of them.

    Attributes:
        header: size of the cell, phases, units.
        mesh: points (n, 2), triangles (m, 3 or 6) and what they belong to; nodes are torn between subdomains.
        fibres: number as in case files (f,), body, phase, centre (f, 2) and radius (f,), on rank 0.
        interface: points (k, 2), normal (k, 2), length (k,) and fibre (k,) of the fibre-matrix interface nodes, and the
            numbers of their nodes in the gathered mesh.
        states: of each load case, or point of an angle or path: displacement and fluctuation (n, 2), stress (m, 3),
            traction, jump (k, 2) and status (k,), with the strain, mean stress, load factor and label of the state.
    """

    comm: Intracomm
    header: Header
    mesh: MeshPart
    fibres: FibrePart
    interface: InterfacePart
    states: tuple[StatePart, ...]

    def gathered(self) -> Fields | None:
        """Return the fields of all ranks as one part, on rank 0; None on the others. Collective."""
        first = self.comm.exscan(len(self.mesh.points)) or 0
        mesh = _gathered(self.comm, replace(self.mesh, triangles=self.mesh.triangles + np.int64(first)))
        fibres, interface = _gathered(self.comm, self.fibres), _gathered(self.comm, self.interface)
        states = [_gathered(self.comm, state) for state in self.states]
        if mesh is None or fibres is None or interface is None:
            return None
        return Fields(
            self.comm, self.header, mesh, fibres, interface, tuple(state for state in states if state is not None)
        )


def _gathered(comm: Intracomm, part: Part) -> Part | None:
    """Return the rows of all ranks, in their order, on rank 0."""
    parts = {name: comm.gather(getattr(part, name)) for name in tables(part)}
    if comm.rank:
        return None
    whole: dict[str, Any] = {name: np.concatenate(rows or []) for name, rows in parts.items()}
    return replace(part, **whole)
