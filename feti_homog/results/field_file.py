"""Write result.h5, with mesh, interface and states, by parallel HDF5 from all ranks."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from feti_homog.errors import FetiHomogError
from feti_homog.results import atomic, field_layout
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import file_locks, records

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


NAME = "result.h5"
PURE_NUMBER = "1"  # unit of dimensionless tables
RESERVE = 1 << 17  # bytes of disk space for the headers that HDF5 adds


@dataclass(frozen=True)
class _Rows:
    """This rank's rows in a table that all ranks share: `count` from row `start` on, of `total` rows in rank order."""

    start: int
    count: int
    total: int


class FieldFile:
    """The unfinished file `directory`/result.h5; every method is collective over `comm`.

    `field_layout` lists tables, attributes and views of tables.  An array without rows has shape (0, ...).

    Until `close` the file has the name `part`.  A `with` block closes the file at its end.  A FetiHomogError on all
    ranks removes the file; any other exception in the block leaves the file unfinished.

    Raises:
        FetiHomogError: the file cannot be written; raised on every rank, after the unfinished file is removed.
        ValueError: tables of one kind have different numbers of rows.
    """

    def __init__(
        self,
        directory: Path,
        comm: Comm,
        header: field_layout.Header,
        mesh: field_layout.MeshPart,
        fibres: field_layout.FibrePart,
        interface: field_layout.InterfacePart,
    ) -> None:
        self._comm = comm
        self.path = Path(directory) / NAME
        self.part: Path = mpi_errors.on_root(comm, atomic.part_of, self.path)
        file_locks.files.add(self.part)
        self._units = {records.LENGTH: header.length_unit, records.STRESS: header.stress_unit}
        counts = {"n": len(mesh.points), "m": len(mesh.triangles), "k": len(interface.points), "f": len(fibres.number)}
        of_ranks = {symbol: comm.allgather(count) for symbol, count in counts.items()}
        self._rows = {symbol: _Rows(sum(n[: comm.rank]), n[comm.rank], sum(n)) for symbol, n in of_ranks.items()}
        self._reserved = RESERVE
        size = RESERVE + sum(map(self._bytes, (mesh, fibres, interface)))
        mpi_errors.on_root(comm, atomic.file_errors("write", self.path)(create), self.part, size)
        self._is_open = True
        self._opened = contextlib.ExitStack()
        # MPI-IO has short name buffers: a descriptor of the folder shortens the name.
        folder = self._agreed(mpi_errors.agree, os.open, self.part.parent, os.O_RDONLY)
        self._opened.callback(os.close, folder)
        path = f"/proc/self/fd/{folder}/{self.part.name}"
        self._file = self._agreed(
            mpi_errors.agree_after, lambda: self._opened.enter_context(h5py.File(path, "r+", driver="mpio", comm=comm))
        )
        attributes = field_layout.attributes(header) | {"created_by": field_layout.PROGRAM}
        self._agreed(mpi_errors.agree_after, self._file.attrs.update, attributes)
        self._write_part("mesh", replace(mesh, triangles=mesh.triangles + np.int64(self._rows["n"].start)))
        self._write_part("fibre", fibres)
        self._write_part("interface", interface)

    def write_state(self, number: int, state: field_layout.StatePart) -> None:
        """Write state `number` (0, 1, ...) and flush the file.  Attributes must be equal on all ranks."""
        group = f"state/{number}"
        self._write_part(group, state)
        attributes = field_layout.attributes(state)
        self._agreed(mpi_errors.agree_after, lambda: self._file[group].attrs.update(attributes))
        self._agreed(mpi_errors.agree_after, self._file.flush)

    def close(self) -> Path:
        """Complete the file with its views, give it its final name, and return its path."""

        def complete() -> None:
            """Add views, and rename the file.  Call on one rank: on all ranks, views would cost as much as tables."""
            # No lock: only this process has the file open, and some file systems have no locks.
            with h5py.File(self.part, "r", locking=False) as file:
                size = (1 << 12) * (1 + len(field_layout.views_of(file)))  # measured: 0.9 KB for each view on average
            _reserve(self.part, self.part.stat().st_size, size)
            with h5py.File(self.part, "r+", locking=False) as file:
                add_views(file)
            atomic.commit(self.part, self.path)

        self._agreed(mpi_errors.agree_after, self._opened.close)
        self._agreed(mpi_errors.on_root_only, complete)
        self._is_open = False
        file_locks.files.discard(self.part)
        return self.path

    def __enter__(self) -> FieldFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._is_open:
            return
        if error is None:
            self.close()
        elif mpi_errors.all_raise(self._comm, error):
            self._remove()

    def _bytes(self, part: Any) -> int:
        """Return an upper bound, in bytes, for the tables of a part and their HDF5 headers, over all ranks."""
        size = 0
        for name, description in field_layout.tables(part).items():
            row_bytes = np.dtype(description.dtype).itemsize * int(np.prod(np.shape(getattr(part, name))[1:]))
            # 4 KiB bound HDF5's header of a table; its measured size is 0.6 KB.
            size += (1 << 12) + row_bytes * self._rows[field_layout.rows_of(description)].total
        return size

    def _write_part(self, group: str, part: Any) -> None:
        """Write the tables of a part to a group, each rank its rows.  Raises ValueError for a wrong number of rows."""
        size = self._bytes(part)
        self._agreed(mpi_errors.on_root_only, _reserve, self.part, self._reserved, size)
        self._reserved += size
        described = field_layout.tables(part)

        def arrays() -> dict[str, NDArray[Any]]:
            converted = {n: np.ascontiguousarray(getattr(part, n), np.dtype(d.dtype)) for n, d in described.items()}
            for name, array in converted.items():
                count = self._rows[field_layout.rows_of(described[name])].count
                if len(array) != count:
                    raise ValueError(f"/{group}/{name} has {len(array)} rows, not {count}")
            return converted

        for name, array in mpi_errors.agree(self._comm, arrays).items():
            description = described[name]
            rows, unit = self._rows[field_layout.rows_of(description)], description.unit
            texts = {"meaning": description.meaning, "unit": self._units.get(unit) or unit or PURE_NUMBER}
            self._agreed(mpi_errors.agree_after, _write_rows, self._file, f"{group}/{name}", rows, array, texts)

    def _agreed(self, agreed: Callable[..., Any], function: Callable[..., Any], *args: Any) -> Any:
        """Call function(*args) through `agreed`, a collective function of `mpi_errors`; return its result.

        After a FetiHomogError on any rank, all ranks remove the file and raise.
        """
        try:
            return agreed(self._comm, atomic.file_errors("write", self.path)(function), *args)
        except FetiHomogError:
            self._remove()
            raise

    def _remove(self) -> None:
        """Truncate, close and remove the file: on a full disk HDF5 closes only empty files.  Collective."""
        self._is_open = False
        file_locks.files.discard(self.part)
        if self._comm.rank == 0:
            with contextlib.suppress(OSError):
                os.truncate(self.part, 0)
        self._comm.barrier()
        with contextlib.suppress(OSError, RuntimeError):
            self._opened.close()
        if self._comm.rank == 0:
            with contextlib.suppress(OSError):
                self.part.unlink()


def create(part: Path, size: int) -> None:
    """Create the HDF5 file `part` without content, and reserve `size` bytes for it.

    HDF5 may crash or hang if a write fails: plain system calls write here.  Raises OSError; then the file is removed.
    """
    part.parent.mkdir(parents=True, exist_ok=True)
    try:
        with h5py.File("empty", "w", driver="core", backing_store=False) as file:
            file.flush()
            empty = bytes(file.id.get_file_image())
        with part.open("wb") as stream:
            stream.write(empty)
            stream.flush()
            os.posix_fallocate(stream.fileno(), 0, size)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def _reserve(part: Path, start: int, size: int) -> None:
    """Reserve `size` bytes of a file from `start` on: without space, MPI-IO may wait forever.  Raises OSError."""
    with part.open("r+b") as stream:
        os.posix_fallocate(stream.fileno(), start, size)


def _write_rows(file: Any, name: str, rows: _Rows, array: NDArray[Any], texts: Mapping[str, str]) -> None:
    """Create the table `name`, and write this rank's rows; a rank without rows takes part.  Collective."""
    table = file.create_dataset(name, (rows.total, *array.shape[1:]), array.dtype)
    table.attrs.update(texts)
    memory, place = h5py.h5s.create_simple(array.shape), table.id.get_space()
    if rows.count:
        place.select_hyperslab((rows.start,) + (0,) * (array.ndim - 1), array.shape)
    else:
        memory.select_none()
        place.select_none()
    transfer = h5py.h5p.create(h5py.h5p.DATASET_XFER)
    transfer.set_dxpl_mpio(h5py.h5fd.MPIO_COLLECTIVE)
    if rows.total:
        table.id.write(memory, place, array, dxpl=transfer)


def add_views(file: Any) -> None:
    """Add all views of `field_layout` to an open file whose tables are complete; empty tables get no views."""
    for group, view in field_layout.views_of(file):
        original = file[f"{group}/{view.source}"]
        shape = (len(original), view.components) if view.components else (len(original),)
        layout = h5py.VirtualLayout(shape, original.dtype)
        for place, (name, column) in view.columns.items():
            table = file[f"{group}/{name}"]
            source = h5py.VirtualSource(".", table.name, shape=table.shape, dtype=table.dtype)
            target: Any = (slice(None), place) if view.components else slice(None)
            layout[target] = source if column is None else source[:, column]
        dataset = file.create_virtual_dataset(view.path(group), layout, np.zeros((), layout.dtype)[()])
        dataset.attrs["meaning"] = f"{view.meaning}; virtual"
        dataset.attrs["unit"] = original.attrs["unit"]
