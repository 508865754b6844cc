"""Check that result.h5 has no tables beyond its own bytes, before a table is read."""

from pathlib import Path
from typing import Any

import h5py

from feti_homog.errors import CaseError
from feti_homog.system.runtime import input_files

MOST_OBJECTS = 1_000_000
MOST_RATIO = 64  # of the bytes of views, tables that show others, to those of the file


def require_own(path: Path) -> None:
    """Require hard links, and tables of numbers that lie in the file.

    A link may lead to a pipe, back to its group or to files of others; a table may declare any size.  Raises CaseError
    also for a missing or damaged file, FetiHomogError without the right to read it.
    """
    if not path.is_file():
        raise CaseError(f"cannot read {path}: No such file or directory")
    size, count = path.stat().st_size, 0
    room = {True: MOST_RATIO * size, False: size}
    try:
        with h5py.File(path, "r", locking=False) as file:
            groups: list[Any] = [file]
            for group in groups:
                for name in group:
                    place, count = f"{group.name.rstrip('/')}/{name}", count + 1
                    if not isinstance(group.get(name, getlink=True), h5py.HardLink) or count > MOST_OBJECTS:
                        raise CaseError(f"{path}: {place} is a link, or one of too many: the file is no result")
                    entry = group[name]
                    if isinstance(entry, h5py.Group):
                        groups.append(entry)
                        continue
                    is_view = isinstance(entry, h5py.Dataset) and entry.is_virtual
                    files = {source.file_name for source in entry.virtual_sources()} if is_view else {"."}
                    is_table = isinstance(entry, h5py.Dataset) and not entry.external and files == {"."}
                    if not is_table or entry.dtype.kind not in "fiu":
                        raise CaseError(f"{path}: {place} is no table of numbers in the file: the file is no result")
                    room[is_view] -= entry.nbytes
                    if room[is_view] < 0:
                        raise CaseError(f"{path}: {place} has more numbers than the file: it is no result")
    except (OSError, RuntimeError, KeyError) as error:
        raise input_files.unreadable(path, error if isinstance(error, OSError) else OSError(str(error))) from error
