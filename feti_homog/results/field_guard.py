"""Check links, sizes, layout and number ranges of all tables in result.h5 before other modules read it."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, get_type_hints

import h5py
import numpy as np

from feti_homog.case import cases
from feti_homog.errors import CaseError
from feti_homog.results import field_layout, result_json
from feti_homog.system.runtime import input_files, records

ATTRIBUTES = {str: "text", tuple[str, ...]: "text", int: "int64"}
# Least and largest numbers; letters stand for the last of n nodes, m elements, k interface nodes, f fibres, p phases.
RANGES: dict[str, tuple[float, float | str]] = {
    **dict.fromkeys(("triangles", "fibre_node", "matrix_node"), (0, "n")), "vertex": (0, "k"), "phase": (0, "p"),
    **dict.fromkeys(("body", "subdomain", "fibre"), (0, "m")), "rank": (0, 1 << 20), "fibre_number": (0, "f"),
    "number": (1, "f"), "pair": (0, 1000), "status": (0, 2), "sliding": (-1, 1), "normal": (-1.01, 1.01),
    "damage": (-1e-6, 1.000001), "refine": (0, 30), "point": (0, 1e9),
    **dict.fromkeys(("length", "radius", "strength", "mesh_error"), (0.0, 1e100)),
}  # fmt: skip
MAY_BE_NAN = ("centre", "radius", "stress_33", "mesh_error")


def require_own(path: Path, state: int | None = None) -> None:
    """Check result.h5 in a child process, because HDF5 may crash on damaged files.

    It refuses soft and external links, which may lead to pipes, other files, or in circles; tables larger than the file
    or outside it; other layouts; a damaged mesh or case; numbers outside RANGES.  With `state`, it skips other states.
    Raises CaseError for these faults, a missing file or a failed child, FetiHomogError without read permission.
    """
    if not path.is_file():
        stored = " and --resume: the checkpoint has its events" if (path.parent / "checkpoint/events").is_file() else ""
        raise CaseError(f"cannot read {path}: it is missing; run the case again with [output] fields = true{stored}")
    input_files.in_own_process(path, partial(require_tables, state=state), (1 << 30) + 4 * path.stat().st_size)


def require_tables(path: Path, state: int | None) -> None:
    """Check result.h5 in this process.  Arguments, refused content and errors are as in `require_own`."""
    room = {"views": 64 * path.stat().st_size, "tables": path.stat().st_size}  # bytes that may follow
    try:
        with h5py.File(path, "r", locking=False) as file:
            groups = [file["/"]]
            for group in groups:  # to which the loop adds the groups inside
                for name in group:
                    if state is not None and group.name.endswith("/state") and name != str(state):
                        continue
                    entry: Any = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
                    if isinstance(entry, h5py.Group) and 1024 * len(groups) < room["views"]:
                        groups.append(entry)
                        continue
                    is_table = isinstance(entry, h5py.Dataset) and entry.shape is not None and entry.dtype.kind in "fiu"
                    if is_table:
                        room["views" if entry.is_virtual else "tables"] -= entry.nbytes
                        sources = entry.virtual_sources() if entry.is_virtual else ()
                        is_table = not entry.external and {source.file_name for source in sources} <= {"."}
                    if not is_table or min(room.values()) < 0:
                        raise CaseError(f"{path}: no result: {group.name}/{name} is not a table of numbers in it")
            _require_layout(path, file, state)
            _require_mesh(path, file)
            for group, view in field_layout.views_of(file, state):
                entry, original = file[view.path(group)], file[f"{group}/{view.source}"]
                shape = (len(original), view.components) if view.components else (len(original),)
                entry[:1]  # reading finds the sources
                if (entry.shape, entry.dtype, entry.is_virtual, entry.fillvalue) != (shape, original.dtype, True, 0):
                    raise CaseError(f"cannot read {path}: /{view.path(group)} is no view of {original.name}")
    except (AttributeError, OSError, RuntimeError, LookupError, TypeError, ValueError) as error:
        raise input_files.unreadable(path, error if isinstance(error, OSError) else OSError(error.args[0])) from error


def _require_layout(path: Path, file: Any, state: int | None) -> None:
    """Refuse tables and attributes unlike `field_layout`, and numbers outside RANGES; `state` as in `require_own`."""
    counted = {"n": "mesh/points", "m": "mesh/triangles", "k": "interface/points", "f": "fibre/number"}
    entries = {"p": file.attrs.get_id("phases"), **{symbol: file[table] for symbol, table in counted.items()}}
    counts = {symbol: entry.shape[0] if entry.shape else 0 for symbol, entry in entries.items()}
    states = [f"state/{number}" for number in range(len(file.get("state", ()))) if state in (None, number)]
    is_spatial = any("axial_stress" in file[name] for name in states)
    parts: dict[str, Any] = {"": field_layout.Header, "mesh": field_layout.MeshPart, "fibre": field_layout.FibrePart}
    of_state = field_layout.SpatialStatePart if is_spatial else field_layout.StatePart
    parts |= {"interface": field_layout.InterfacePart, **dict.fromkeys(states, of_state)}
    for group, part in parts.items():
        hints, attributes = get_type_hints(part), file[f"/{group}"].attrs
        for name, description in records.descriptions(part).items():
            is_table, key = bool(field_layout.rows_of(description)), description.name or name
            entry = file[f"{group}/{name}"] if is_table else attributes.get_id(key)
            is_text = h5py.check_string_dtype(entry.dtype) == ("utf-8", None)
            actual = f"{'text' if is_text else entry.dtype.newbyteorder('=')} {entry.shape}"
            shape = description.shape or "()"  # such as (n, 2), whose first letter may stand for a number of rows
            expected = f"{ATTRIBUTES.get(hints[name], description.dtype)} ({counts.get(shape[1], shape[1])}{shape[2:]}"
            place = f"cannot read {path}: {f'/{group}'.rstrip('/')}/{name}"
            if actual not in (expected, *(expected.replace("3 or 6", columns) for columns in "36")):
                raise CaseError(f"{place} is {actual}, expected {expected}")
            if not is_text:
                _require_values(place, name, counts, entry if is_table else attributes[key])


def _blocks(table: Any) -> Iterator[Any]:
    """Yield the rows of a table (n, ...) in blocks that fit in memory."""
    for start in range(0, len(table), 1 << 16):
        yield table[start : start + (1 << 16)]


def _require_values(place: str, name: str, counts: Mapping[str, int], table: Any) -> None:
    """Compare the numbers `name` of a table or attribute with RANGES.  Raises CaseError, which begins with `place`."""
    low, high = RANGES.get(name, (-1e100, 1e100))  # as in case files
    if isinstance(high, str):  # fibres count from 1, all others from 0
        high = counts[high] if high == "f" else counts[high] - 1
    for values in map(np.asarray, _blocks(table) if table.ndim else [table]):
        is_in_range = (np.float64(low) <= values) & (values <= np.float64(high))
        is_wrong = ~is_in_range & ~(np.isnan(values) & (name in MAY_BE_NAN))
        if is_wrong.any():
            raise CaseError(f"{place} has the number {values[is_wrong][0]:g}, expected {low:g} to {high:g}")


def _require_mesh(path: Path, file: Any) -> None:
    """Check the case, element areas, fibres, interface nodes, and names of phases and states.  Raises CaseError."""
    try:
        cases.check_stored(case := result_json.loads(file.attrs["case"]))
    except (CaseError, ValueError) as error:
        raise CaseError(f"cannot read {path}: the case in it is damaged: {str(error).splitlines()[0]}") from error
    points, triangles, flat = file["mesh/points"][()], file["mesh/triangles"], 0
    size, refine = np.array([file.attrs["width"], file.attrs["height"]]), file.attrs["refine"]
    span = points.max(axis=0, initial=-np.inf) - points.min(axis=0, initial=np.inf)
    if not ((size > 0.0) & (size <= 4.0 * span)).all() or len(triangles) % 4**refine or not len(triangles):
        raise CaseError(f"cannot read {path}: a cell of {size[0]:g} x {size[1]:g}, refine = {refine}, has other nodes")
    for block in _blocks(triangles):
        (x1, y1), (x2, y2) = (np.transpose(points[block[:, k]] - points[block[:, 0]]) for k in (1, 2))
        flat += int(np.count_nonzero(x1 * y2 - x2 * y1 <= 1e-20 * span.prod()))
    gap = np.stack([file["interface/points"] - points[file[f"interface/{face}_node"]] for face in ("fibre", "matrix")])
    phases = file.attrs["phases"]
    names = [*phases, *(state.attrs["label"] for state in file.get("state", {}).values())]
    for holds, fault in (
        (not flat, f"{flat} elements have no area"),
        (np.isin(file["fibre/body"], file["mesh/body"]).all(), "a fibre has no elements"),
        ((np.abs(gap - size * np.round(gap / size)) <= 1e-5 * size.max()).all(), "interface nodes are not in the mesh"),
        (all({phase, phase.partition(":")[0]} & {*case["material"]} for phase in phases), "its case has other phases"),
        (all(map(str.isprintable, names)) and "$" not in "".join(names), "a name has $ or is not printable"),
    ):
        if not holds:
            raise CaseError(f"cannot read {path}: {fault}")
