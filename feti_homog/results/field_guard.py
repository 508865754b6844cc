"""Check links, sizes and layout of all tables in result.h5 before any table is read."""

from pathlib import Path
from typing import Any

import h5py

from feti_homog.errors import CaseError
from feti_homog.results.field_layout import FibrePart, InterfacePart, MeshPart, SpatialStatePart, StatePart, tables
from feti_homog.system.runtime import input_files


def require_own(path: Path) -> None:
    """Refuse links other than hard links, tables that are larger than the file or lie elsewhere, and other layouts.

    Other links may lead to pipes, other files, or in circles.  Raises CaseError; FetiHomogError for an unreadable file.
    """
    if not path.is_file():
        has_events = (path.parent / "checkpoint/events").is_file()
        stored = " with --resume: the checkpoint has its events" if has_events else ""
        raise CaseError(f"cannot read {path}: it is missing; run the case again{stored}")
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
                        raise CaseError(f"{path}: no result: {group.name}/{name} is not a table of numbers in it")
            _require_layout(path, file)
    except (AttributeError, OSError, RuntimeError, KeyError) as error:
        raise input_files.unreadable(path, error if isinstance(error, OSError) else OSError(error.args[0])) from error


def _require_layout(path: Path, file: Any) -> None:
    """Compare shapes and types with `field_layout`; the tables of points, triangles and fibres give the row counts."""
    counted = {"n": "mesh/points", "m": "mesh/triangles", "k": "interface/points", "f": "fibre/number"}
    counts = {symbol: (*file[table].shape, 0)[0] for symbol, table in counted.items()}
    states = [f"state/{number}" for number in range(len(file.get("state", ())))]
    of_state = SpatialStatePart if any("axial_stress" in file[state] for state in states) else StatePart
    parts = {"mesh": MeshPart, "fibre": FibrePart, "interface": InterfacePart, **dict.fromkeys(states, of_state)}
    for group, part in parts.items():
        for name, d in tables(part).items():
            table, expected = file[f"{group}/{name}"], f"{d.dtype} ({counts[d.shape[1]]}{d.shape[2:]}"
            shown = f"{table.dtype.newbyteorder('=')} {table.shape}"
            if shown not in (expected, *(expected.replace("3 or 6", columns) for columns in "36")):
                raise CaseError(f"cannot read {path}: /{group}/{name} is {shown}, expected {expected}")
