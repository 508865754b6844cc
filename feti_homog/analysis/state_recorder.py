"""Recorder of the states of a run."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from feti_homog.analysis.result import Fields
from feti_homog.errors import FetiHomogError
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.results import field_parts, seals
from feti_homog.results.field_file import FieldFile
from feti_homog.results.field_layout import StatePart
from feti_homog.results.seals import FileSeal
from feti_homog.system.parallel.mpi_errors import on_root


class StateRecorder:
    """Recorder of the states of a run: to the file if there is one, and to memory if they are to be kept.

    Attributes:
        has_place: whether states go anywhere.
        error: why the file was given up; the numbers are computed without it.
    """

    def __init__(self, cell: TornCell, file: FieldFile | None, keep: bool, say: Callable[[str], object]) -> None:
        self._cell, self._file, self._keep = cell, file, keep
        self._number, self._states, self._say = count(), list[StatePart](), say
        self.has_place = keep or file is not None
        self.error: FetiHomogError | None = None

    def record(
        self, plane: Response | None, axial: Response | None, load_factor: float, label: str, point: int
    ) -> None:
        """Take responses, one of which may be None, as the next state; collective."""
        if self._file is None and not self._keep:
            return
        state = self._state(plane, axial, load_factor, label, point)
        self._write(lambda file: file.write_state(next(self._number), state))
        if self._keep:
            self._states.append(state)

    def _state(
        self, plane: Response | None, axial: Response | None, load_factor: float, label: str, point: int
    ) -> StatePart:
        if plane is None or len(self._cell.problems) > 1:
            return field_parts.spatial_state_part(self._cell, plane, axial, load_factor, label, point)
        return field_parts.state_part(self._cell, plane, load_factor, label, point)

    def seal(self) -> FileSeal | None:
        """Complete the file; returns its seal, None without a file.  Collective."""
        self._write(FieldFile.close)
        return None if self._file is None else on_root(self._cell.comm, seals.seal, self._file.path)

    def _write(self, write: Callable[[FieldFile], object]) -> None:
        """Do it to the file if there is one; if it cannot be written, which all ranks hear, there is none any more."""
        if self._file is not None:
            try:
                write(self._file)
            except FetiHomogError as error:
                self._file, self.error = None, error
                self._say(f"warning: {error}; the remaining results are computed without it")

    def kept(self) -> Fields | None:
        """Return this rank's fields if they are kept."""
        if not self._keep:
            return None
        cell = self._cell
        mesh, interface = field_parts.mesh_part(cell), field_parts.interface_part(cell)
        fibres = field_parts.fibre_part(cell)
        return Fields(cell.comm, field_parts.header(cell), mesh, fibres, interface, tuple(self._states))
