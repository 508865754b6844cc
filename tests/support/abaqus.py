"""Meshes as Abaqus input files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_inp(path: Path, mesh: Any, sets: bool = True, elements: Mapping[int, str] | None = None) -> Path:
    """Write an `MshFile` as one part; phases and curves are element sets, or the ELSET of its *ELEMENT lines."""
    lines = ["*HEADING", "a mesh", "** a comment", "*PART, NAME=cell", "*NODE, NSET=all"]
    lines += [f"{tag}, {x!r}, {y!r}" for tag, (x, y, _) in mesh.nodes.items()]
    kinds = {2: "CPE3", 3: "CPE4", 9: "CPE6M", 1: "T2D2", 8: "T3D3", **(elements or {})}
    names = mesh.names | mesh.curves
    for phase in sorted({e[1] for e in mesh.elements.values()}):
        for kind in sorted({e[0] for e in mesh.elements.values() if e[1] == phase}):
            own = {t: e for t, e in mesh.elements.items() if e[:2] == (kind, phase)}
            lines.append(f"*Element, type={kinds[kind]}, elset={f'surface{phase}' if sets else names[phase]}")
            lines += [", ".join(map(str, (tag, *_nodes(e)))) for tag, e in own.items()]
    if sets:
        for phase, name in names.items():
            tags = [tag for tag, e in mesh.elements.items() if e[1] == phase]
            lines += [
                f"*ELSET, ELSET={name.upper()}",
                *(", ".join(map(str, tags[k : k + 8])) + "," for k in range(0, len(tags), 8)),
            ]
    path.write_text("\n".join([*lines, "*END PART", ""]))
    return path


def _nodes(element: Any) -> tuple[int, ...]:
    """Return the nodes in Abaqus's order, which has the middle of a line between its ends."""
    kind, *_, nodes = element
    return (nodes[0], nodes[2], nodes[1]) if kind == 8 else nodes
