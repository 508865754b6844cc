"""result.h5: mesh, interface and states, written by all ranks together (parallel HDF5)."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from feti_homog.common.mpi_errors import agree, on_root
from feti_homog.errors import FetiHomogError
from feti_homog.output.files import atomic
from feti_homog.typing import AnyInt, Float

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


NAME = "result.h5"
INTEGERS = {name: np.int32 for name in ("body", "subdomain", "phase", "fibre")}
TYPES = INTEGERS | {"triangles": np.int64, "status": np.int8}  # all other tables are float64
RESERVE = 1 << 17  # bytes for what HDF5 itself adds to the tables of a group


@dataclass(frozen=True)
class Header:
    """The file's attributes. Lengths in `length_unit`; the units are labels and may be empty."""

    title: str
    version: str  # of the program
    width: float
    height: float
    order: int
    refine: int
    phases: tuple[str, ...]
    length_unit: str = ""
    stress_unit: str = ""


@dataclass(frozen=True)
class MeshPart:
    """This rank's n nodes and m triangles, one subdomain after the other; nodes are torn between subdomains.

    Each group of 4**refine consecutive triangles fills one coarse triangle.
    """

    points: Float  # (n, 2)
    triangles: AnyInt  # (m, 3), or (m, 6): vertices, then mid-edge nodes 01, 12, 20; this rank's numbers
    body: AnyInt  # (m,)
    subdomain: AnyInt  # (m,)
    phase: AnyInt  # (m,) index into Header.phases


@dataclass(frozen=True)
class InterfacePart:
    """The k fibre-matrix interface nodes whose multipliers this rank owns; k may be 0."""

    points: Float  # (k, 2)
    normal: Float  # (k, 2) from fibre to matrix
    length: Float  # (k,) tributary
    fibre: AnyInt  # (k,)


@dataclass(frozen=True)
class StatePart:
    """One load case or state of the cell and this rank's part of its fields."""

    strain: Float  # (3,) E11, E22, gamma12 of the cell
    stress_mean: Float  # (3,) S11, S22, S12 of the cell
    load_factor: float
    label: str  # what the state is, in words: "60 deg E11", "event 12"
    displacement: Float  # (n, 2)
    fluctuation: Float  # (n, 2)
    stress: Float  # (m, 3) element means of S11, S22, S12
    traction: Float  # (k, 2) normal, tangential
    jump: Float  # (k, 2) normal, tangential
    status: AnyInt  # (k,) 0 bonded, 1 closed, 2 open


@dataclass(frozen=True)
class _Rows:
    """The place of this rank's rows in a table that all ranks share, in the order of the ranks."""

    start: int
    count: int
    total: int

    @classmethod
    def of(cls, comm: Comm, count: int) -> _Rows:
        counts = comm.allgather(count)
        return cls(sum(counts[: comm.rank]), count, sum(counts))


class FieldFile:
    """The file `directory`/result.h5 while it is being written; every method is collective over `comm`.

    - /mesh: points (n,2), triangles (m,3 or 6), body, subdomain, phase (m,)
    - /interface: points, normal (k,2), length, fibre (k,)
    - /state/K: displacement, fluctuation (n,2), stress (m,3), traction, jump (k,2), status (k,);
      attributes strain (3,), stress (3,), load_factor, label
    - /vector/interface/normal, /vector/state/K/displacement, fluctuation: with a third component 0, as
      virtual datasets, which take no space

    Until `close` the file is called `part`. As a context manager it closes when the block ends well;
    after an exception it leaves the unfinished file. Empty parts still need their columns: shape (0, 2).

    Raises:
        FetiHomogError: the file cannot be written; on every rank, and what there was of it is removed.
    """

    def __init__(self, directory: Path, comm: Comm, header: Header, mesh: MeshPart, interface: InterfacePart) -> None:
        self._comm = comm
        self._path = Path(directory) / NAME
        self.part: Path = on_root(comm, atomic.part_of, self._path)
        self._nodes = _Rows.of(comm, len(mesh.points))
        self._elements = _Rows.of(comm, len(mesh.triangles))
        self._interface = _Rows.of(comm, len(interface.points))
        on_root(comm, _with_write_errors, self._path, _probe, self.part, comm.size)
        self._file = agree(comm, _with_write_errors, self._path, _create, self.part, comm)
        self._collectively(_set_attributes, self._file, asdict(header) | {"created_by": "feti_homog"})
        elements = {"triangles": mesh.triangles + np.int64(self._nodes.start), "body": mesh.body}
        elements |= {"subdomain": mesh.subdomain, "phase": mesh.phase}
        self._write("mesh", self._nodes, {"points": mesh.points})
        self._write("mesh", self._elements, elements)
        self._write("interface", self._interface, vars(interface))
        self._view("interface/normal", self._interface)

    def write_state(self, number: int, state: StatePart) -> None:
        """Adds state `number` (0, 1, ...) and flushes. The cell's own numbers are the same on all ranks."""
        name = f"state/{number}"
        self._write(name, self._nodes, {"displacement": state.displacement, "fluctuation": state.fluctuation})
        self._write(name, self._elements, {"stress": state.stress})
        interface = {"traction": state.traction, "jump": state.jump, "status": state.status}
        self._write(name, self._interface, interface)
        means = {"strain": state.strain, "stress": state.stress_mean, "load_factor": state.load_factor}
        means |= {"label": state.label}
        self._collectively(_set_attributes, self._file[name], means)
        self._view(f"{name}/displacement", self._nodes)
        self._view(f"{name}/fluctuation", self._nodes)
        self._collectively(self._file.flush)

    def close(self) -> Path:
        """Completes the file, gives it its final name, and returns its path."""
        self._collectively(self._file.close)
        on_root(self._comm, _with_write_errors, self._path, atomic.commit, self.part, self._path)
        return self._path

    def __enter__(self) -> FieldFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()

    def _write(self, group: str, rows: _Rows, tables: Mapping[str, Any]) -> None:
        """Makes the tables of a group, each rank giving its rows."""
        arrays = agree(self._comm, _arrays, group, rows.count, tables)
        row = sum(array.dtype.itemsize * int(np.prod(array.shape[1:])) for array in arrays.values())
        self._collectively(_reserve, self._comm.rank, self.part, row * rows.total)
        for name, array in arrays.items():
            self._collectively(_write_rows, self._file, f"{group}/{name}", rows, array)

    def _view(self, name: str, rows: _Rows) -> None:
        """The table `name` (rows, 2) as /vector/`name` (rows, 3)."""
        if rows.total:
            layout = h5py.VirtualLayout((rows.total, 3), dtype=np.float64)
            layout[:, :2] = h5py.VirtualSource(".", name, shape=(rows.total, 2), dtype=np.float64)
            self._collectively(self._file.create_virtual_dataset, f"vector/{name}", layout, 0.0)

    def _collectively(self, function: Callable[..., object], *args: Any) -> None:
        """function(*args) on all ranks; if any cannot write, the file is removed and all raise."""
        try:
            agree(self._comm, _with_write_errors, self._path, function, *args)
        except FetiHomogError:
            self._remove()
            raise

    def _remove(self) -> None:
        """Closes and removes the file. On a full disk HDF5 can close it only after it was cut to nothing."""
        if self._comm.rank == 0:
            with contextlib.suppress(OSError):
                os.truncate(self.part, 0)
        self._comm.barrier()
        with contextlib.suppress(OSError, RuntimeError):
            self._file.close()
        if self._comm.rank == 0:
            with contextlib.suppress(OSError):
                self.part.unlink()


def _with_write_errors(path: Path, function: Callable[..., Any], *args: Any) -> Any:
    """function(*args), its failures in words about `path`."""
    with atomic.write_errors(path):
        return function(*args)


def _probe(part: Path, ranks: int) -> None:
    """Finds out in plain terms whether the file can be made, before MPI-IO tries."""
    if ranks > 1 and not h5py.get_config().mpi:
        raise FetiHomogError(f"h5py is built without MPI: {ranks} ranks cannot write {NAME}")
    part.parent.mkdir(parents=True, exist_ok=True)
    part.open("wb").close()


def _create(part: Path, comm: Comm) -> Any:
    return h5py.File(part, "w", driver="mpio", comm=comm) if h5py.get_config().mpi else h5py.File(part, "w")


def _set_attributes(target: Any, attributes: Mapping[str, Any]) -> None:
    for key, value in attributes.items():
        target.attrs[key] = value


def _arrays(group: str, count: int, tables: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    types = {name: TYPES.get(name, np.float64) for name in tables}
    arrays = {name: np.ascontiguousarray(table, types[name]) for name, table in tables.items()}
    for name, array in arrays.items():
        if len(array) != count:
            raise ValueError(f"/{group}/{name} has {len(array)} rows, not {count}")
    return arrays


def _reserve(rank: int, part: Path, size: int) -> None:
    """Takes the space on the disk: were it to end while MPI-IO writes, some ranks might wait for ever."""
    if rank == 0:
        with part.open("r+b") as stream:
            os.posix_fallocate(stream.fileno(), stream.seek(0, os.SEEK_END), size + RESERVE)


def _write_rows(file: Any, name: str, rows: _Rows, array: NDArray[Any]) -> None:
    """Makes a table and writes this rank's rows. An empty rank takes part with an empty selection."""
    table = file.create_dataset(name, (rows.total, *array.shape[1:]), array.dtype)
    memory, place = h5py.h5s.create_simple(array.shape), table.id.get_space()
    if rows.count:
        place.select_hyperslab((rows.start,) + (0,) * (array.ndim - 1), array.shape)
    else:
        memory.select_none()
        place.select_none()
    transfer = h5py.h5p.create(h5py.h5p.DATASET_XFER)
    if h5py.get_config().mpi:
        transfer.set_dxpl_mpio(h5py.h5fd.MPIO_COLLECTIVE)
    if rows.total:
        table.id.write(memory, place, array, dxpl=transfer)
