"""Check that result.h5 has no tables beyond its own bytes, before a table is read."""

from pathlib import Path
from typing import Any

import h5py

from feti_homog.errors import CaseError
from feti_homog.system.runtime import input_files


def require_own(path: Path) -> None:
    """Refuse links other than hard links, and tables that are larger than the file or lie elsewhere.

    Other links may lead to pipes, other files or back.  Raises CaseError; FetiHomogError for an unreadable file.
    """
    if not path.is_file():
        raise CaseError(f"cannot read {path}: it is missing; run the case again")
    room = {True: 64 * path.stat().st_size, False: path.stat().st_size}  # of views, which show tables, and of tables
    try:
        with h5py.File(path, "r", locking=False) as file:
            groups = [file["/"]]
            for group in groups:
                for name in group:
                    entry: Any = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
                    if isinstance(entry, h5py.Group) and len(groups) << 10 < room[True]:
                        groups.append(entry)
                        continue
                    is_table = isinstance(entry, h5py.Dataset) and not entry.external and entry.dtype.kind in "fiu"
                    if is_table:
                        room[entry.is_virtual] -= entry.nbytes
                        is_table = not entry.is_virtual or {s.file_name for s in entry.virtual_sources()} == {"."}
                    if not is_table or min(room.values()) < 0:
                        raise CaseError(f"{path}: no result: {group.name}/{name} is no table of numbers within it")
    except (OSError, RuntimeError, KeyError) as error:
        raise input_files.unreadable(path, error if isinstance(error, OSError) else OSError(str(error))) from error
