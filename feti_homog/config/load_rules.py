"""Reading the section [path], and what must hold between its keys."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from feti_homog.config.load_section import LoadPath, Strain
from feti_homog.config.schema import TableReader
from feti_homog.config.wording import toml_value

ZERO: Strain = (0.0, 0.0, 0.0)


def read_path(table: Any, reader: TableReader) -> LoadPath | None:
    """The section [path]; None if it is absent or faulty."""
    if table is None:
        return None
    path = reader.read(LoadPath, table, "path")
    if path is not None:
        reader.faults += _path_faults(path)
    return path


def _path_faults(path: LoadPath) -> list[str]:
    faults = []
    if (path.strain is None) == (path.waypoints is None):
        state = "missing; give one" if path.strain is None else "exclude each other; give one"
        faults.append(f"[path] strain, waypoints: {state}")
    elif path.strain is not None and not any(path.strain):
        faults.append("[path] strain: expected a strain other than zero, where the path begins")
    elif path.waypoints is not None:
        faults += _repeated_waypoints(path.waypoints)
    if path.increments is not None and path.increments < len(path.targets):
        faults.append(f"[path] increments = {path.increments}: expected at least one for each waypoint")
    return faults


def _repeated_waypoints(waypoints: tuple[Strain, ...]) -> list[str]:
    """Faults of waypoints at which the path already is."""
    repeated = [k for k, (before, after) in enumerate(pairwise([ZERO, *waypoints])) if before == after]
    return [
        f"[path] waypoints[{k}] = {toml_value(list(waypoints[k]))}: expected a strain other than "
        + (f"waypoints[{k - 1}]" if k else "zero, where the path begins")
        for k in repeated
    ]
