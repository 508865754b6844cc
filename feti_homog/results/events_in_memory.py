"""Events of paths that leave no files: not kept, or kept in memory."""

from __future__ import annotations

import pickle
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.results import checkpoint_file
from feti_homog.results.checkpoint import WHOLE_BYTES, Checkpoint
from feti_homog.results.checkpoint_file import Arrays


class NoCheckpoint(Checkpoint):
    """Keeps nothing, for runs that leave no files."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        super().__init__(Path(), comm, "")

    def clear(self) -> int:
        return 0

    def count(self) -> int:
        return 0

    def write(
        self,
        number: int,
        whole: Mapping[str, Any],
        distributed: Mapping[str, NDArray[Any]],
        light: bool = False,
        settled: int = -1,
    ) -> None:
        """Nothing."""

    def flush(self) -> None:
        """Nothing."""


class EventsInMemory(NoCheckpoint):
    """Keeps the events for fields in memory, for runs that leave no files: what stands on the interfaces, by rank.

    Older ones become lean as those of files do, and are packed.
    """

    def __init__(self, comm: MPI.Intracomm, room: int | None = WHOLE_BYTES) -> None:
        super().__init__(comm)
        self.room = room
        self._whole: dict[int, Arrays] = {}
        self._packed: list[bytes] = []

    def read(self, number: int) -> Arrays:
        if number >= len(self._packed):
            return self._whole[number]
        event: Arrays = pickle.loads(zlib.decompress(self._packed[number]))
        return event

    def write(
        self,
        number: int,
        whole: Mapping[str, Any],
        distributed: Mapping[str, NDArray[Any]],
        light: bool = False,
        settled: int = -1,
    ) -> None:
        self._whole[number] = {name: np.asarray(value) for name, value in {**whole, **distributed}.items()}
        self._bytes += _size(self._whole[number])
        if self.room is not None and settled > len(self._packed) and self.comm.allreduce(self._bytes) > self.room:
            for earlier in range(len(self._packed), settled):
                event = self._whole.pop(earlier)
                self._bytes -= _size(event)
                self._packed.append(zlib.compress(pickle.dumps(checkpoint_file.lean(event)), 1))


def _size(event: Arrays) -> int:
    return sum(value.nbytes for value in event.values())
