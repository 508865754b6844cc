"""Check links, sizes and layout of all tables in result.h5 before any table is read."""

from math import inf
from pathlib import Path
from typing import Any, get_type_hints

import h5py

from feti_homog.case import cases
from feti_homog.errors import CaseError
from feti_homog.results import field_layout, result_json
from feti_homog.system.runtime import input_files, records

ATTRIBUTES = {str: "text", tuple[str, ...]: "text", int: "int64"}


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
                    is_table = (
                        isinstance(entry, h5py.Dataset)
                        and entry.shape is not None
                        and not entry.external
                        and entry.dtype.kind in "fiu"
                    )
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
    entries = {"p": file.attrs.get_id("phases"), **{symbol: file[table] for symbol, table in counted.items()}}
    counts = {symbol: str((*(entry.shape or ()), 0)[0]) for symbol, entry in entries.items()}
    states = [f"state/{number}" for number in range(len(file.get("state", ())))]
    is_spatial = any("axial_stress" in file[state] for state in states)
    parts: dict[str, Any] = {"": field_layout.Header, "mesh": field_layout.MeshPart, "fibre": field_layout.FibrePart}
    of_state = field_layout.SpatialStatePart if is_spatial else field_layout.StatePart
    parts |= {"interface": field_layout.InterfacePart, **dict.fromkeys(states, of_state)}
    for group, part in parts.items():
        hints = get_type_hints(part)
        for name, d in records.descriptions(part).items():
            attributes, shape = file[f"/{group}"].attrs, d.shape or "()"
            entry = file[f"{group}/{name}"] if field_layout.rows_of(d) else attributes.get_id(d.name or name)
            is_text = h5py.check_string_dtype(entry.dtype) == ("utf-8", None)
            shown = f"{'text' if is_text else entry.dtype.newbyteorder('=')} {entry.shape}"
            expected = f"{ATTRIBUTES.get(hints[name], d.dtype)} ({counts.get(shape[1], shape[1])}{shape[2:]}"
            if shown not in (expected, *(expected.replace("3 or 6", columns) for columns in "36")):
                raise CaseError(f"cannot read {path}: {f'/{group}'.rstrip('/')}/{name} is {shown}, expected {expected}")
    points, refine = file["mesh/points"][()], file.attrs["refine"]
    spans = points.max(axis=0, initial=-inf) - points.min(axis=0, initial=inf)
    sizes = file.attrs["width"], file.attrs["height"]
    if refine < 0 or not all(0.0 < size <= 4.0 * span for size, span in zip(sizes, spans, strict=True)):
        raise CaseError(
            f"cannot read {path}: a cell of {sizes[0]:g} x {sizes[1]:g}, refine = {refine}, has other nodes"
        )
    try:
        cases.check_stored(result_json.loads(file.attrs["case"]))
    except (CaseError, ValueError) as error:
        raise CaseError(f"cannot read {path}: the case in it is damaged: {str(error).splitlines()[0]}") from error
