"""Checkpoints of a path: one small HDF5 file an event, written whole or not at all.

Rank 0 writes what the ranks' parts add up to; it concerns the interfaces only.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.parallel import on_root, on_root_only

FOLDER = "checkpoint"

Arrays = dict[str, NDArray[Any]]


class Checkpoint:
    """The events of one path in `directory`/checkpoint; every method is collective.

    Attributes:
        signature: text that an event must carry to belong to this run: case, mesh and ranks.
    """

    def __init__(self, directory: Path, comm: MPI.Intracomm, signature: str) -> None:
        self.folder, self.comm, self.signature = directory / FOLDER, comm, signature

    def clear(self) -> int:
        """Forget all events; returns how many there were."""
        return on_root(self.comm, self._clear)

    def read(self) -> list[Arrays]:
        """The events so far, in their order: this rank's part of distributed arrays, all of the others.

        Raises:
            CaseError: an event is unreadable or of another run.
        """
        events = on_root_only(self.comm, self._read_all)
        parts = None if events is None else [[_part(e, rank) for e in events] for rank in range(self.comm.size)]
        own: list[Arrays] = self.comm.scatter(parts or [])
        return own

    def write(self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]]) -> None:
        """Add event `number`: numbers that all ranks share, and arrays of which each has a part.

        Raises:
            FetiHomogError: the file cannot be written.
        """
        gathered = {name: self.comm.gather(part) for name, part in distributed.items()}
        on_root(self.comm, self._write, number, whole, gathered)

    def _clear(self) -> int:
        count = len(self._files())
        shutil.rmtree(self.folder, ignore_errors=True)
        return count

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob("[0-9]*.h5")) if self.folder.is_dir() else []

    def _read_all(self) -> list[Arrays]:
        events = []
        for number, path in enumerate(self._files()):
            try:
                with h5py.File(path, "r") as file:
                    signature = file.attrs["signature"]
                    events.append({name: table[()] for name, table in file.items()})
            except (OSError, KeyError, RuntimeError) as error:
                raise CaseError(f"--resume: {path} is no readable event of a path: {error}") from error
            if signature != self.signature:
                raise CaseError(
                    f"--resume: {path} is of another run: expected {self.signature}, found {signature}"
                )
            if path.stem != f"{number:06d}":
                raise CaseError(f"--resume: event {number:06d} is missing in {self.folder}")
        return events

    def _write(self, number: int, whole: Mapping[str, Any], gathered: Mapping[str, list[NDArray[Any]]]) -> None:
        path = self.folder / f"{number:06d}.h5"
        part = path.with_suffix(".part")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with h5py.File(part, "w") as file:
                file.attrs["signature"] = self.signature
                for name, value in whole.items():
                    file[name] = value
                for name, parts in gathered.items():
                    file[name] = np.concatenate(parts)
                    file[f"{name}_ends"] = np.cumsum([len(p) for p in parts])
            os.replace(part, path)
        except (OSError, RuntimeError) as error:
            raise FetiHomogError(f"cannot write {path}: {error}") from error


def _part(event: Arrays, rank: int) -> Arrays:
    """The event with a rank's share of the distributed arrays."""
    part = {}
    for name, table in event.items():
        if name.endswith("_ends"):
            continue
        ends = event.get(f"{name}_ends")
        if ends is not None:
            table = table[ends[rank - 1] if rank else 0 : ends[rank]]
        part[name] = table
    return part
