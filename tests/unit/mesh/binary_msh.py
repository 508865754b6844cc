"""Meshes as binary files of gmsh, in either byte order."""

from pathlib import Path

import numpy as np
from unit.mesh.faulty_meshes import MshFile


def write_binary(mesh: MshFile, path: Path, version: str, order: str) -> Path:
    """Write a mesh in version 2.2 or 4.1, in the byte order `<` or `>`."""

    def whole(*values: int, size: int = 4) -> bytes:
        return np.array(values, f"{order}i{size}").tobytes()

    def reals(*values: float) -> bytes:
        return np.array(values, f"{order}f8").tobytes()

    names = [f'1 {tag} "{name}"' for tag, name in mesh.curves.items()]
    names += [f'2 {tag} "{name}"' for tag, name in mesh.names.items()]
    text = ["$PhysicalNames", str(len(names)), *names, "$EndPhysicalNames", ""]
    head = f"$MeshFormat\n{version} 1 8\n".encode() + whole(1) + b"\n$EndMeshFormat\n" + "\n".join(text).encode()
    parts = (_version_2 if version == "2.2" else _version_4)(mesh, whole, reals)
    sections = (f"${name}\n".encode() + body + f"\n$End{name}\n".encode() for name, body in parts.items())
    path.write_bytes(head + b"".join(sections))
    return path


def _version_2(mesh, whole, reals):
    nodes = b"".join(whole(tag) + reals(*place) for tag, place in mesh.nodes.items())
    elements = b"".join(
        whole(kind, 1, 2, tag, physical, entity, *corners)
        for tag, (kind, physical, entity, corners) in mesh.elements.items()
    )
    return {"Nodes": f"{len(mesh.nodes)}\n".encode() + nodes, "Elements": f"{len(mesh.elements)}\n".encode() + elements}


def _version_4(mesh, whole, reals):
    def sizes(*values):
        return whole(*values, size=8)

    dimension = {1: 1, 8: 1, 2: 2, 9: 2}
    blocks: dict[tuple, list] = {}
    for tag, (kind, physical, entity, corners) in mesh.elements.items():
        blocks.setdefault((dimension[kind], entity, kind, physical), []).append((tag, *corners))
    entities = dict.fromkeys((key[0], key[1], key[3]) for key in sorted(blocks))
    counts = [sum(entity[0] == d for entity in entities) for d in range(4)]
    rows = (whole(entity) + reals(*[0.0] * 6) + sizes(1) + whole(group) + sizes(0) for _, entity, group in entities)
    nodes = sizes(1, len(mesh.nodes), min(mesh.nodes), max(mesh.nodes)) + whole(2, 1, 0) + sizes(len(mesh.nodes))
    nodes += sizes(*mesh.nodes) + b"".join(reals(*place) for place in mesh.nodes.values())
    elements = sizes(len(blocks), len(mesh.elements), min(mesh.elements), max(mesh.elements))
    for (dim, entity, kind, _), own in blocks.items():
        elements += whole(dim, entity, kind) + sizes(len(own)) + b"".join(sizes(*row) for row in own)
    return {"Entities": sizes(*counts) + b"".join(rows), "Nodes": nodes, "Elements": elements}
