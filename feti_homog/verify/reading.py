"""Read a result folder: result.json with the case, result.h5 with mesh, interface and states."""

import json
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from feti_homog.errors import CaseError
from feti_homog.system.runtime import input_files
from feti_homog.typing import AnyInt, Float, Int
from feti_homog.verify.findings import Points, Section

JSON, FIELDS, SCHEMA = "result.json", "result.h5", 1
MISSING_FIELDS = "only a run with `fields = true` in [output] can be verified"
CHECKSUM_BLOCK = 1 << 26  # bytes
COATING = "coating"  # name of the phase


@dataclass(frozen=True)
class Mesh:
    """The mesh: nodes (n, 2), elements (m, 3 or 6), and their subdomains, phases and bodies (m,).

    An element lists its vertices, then the mid-side nodes 01, 12, 20.  Subdomains share no node; phase 0 is the matrix.
    """

    points: Float
    triangles: Int
    subdomain: AnyInt
    phase: AnyInt
    body: AnyInt


@dataclass(frozen=True)
class InterfaceRows:
    """The k interface nodes: points (k, 2), normals (k, 2) from fibre to matrix, tributary lengths (k,).

    `fibre` (k,) counts from 1, `body` (k,) is the body of the fibre, `pair` (k,) the index of [[interface]].
    """

    points: Float
    normal: Float
    length: Float
    fibre: AnyInt
    body: AnyInt
    pair: AnyInt


@dataclass(frozen=True)
class Fibres:
    """The f fibres: bodies (f,), centres (f, 2) and radii (f,), NaN where undefined.

    `strength` (f,) is the bond strength, relative to the strength in the case.
    """

    body: AnyInt
    centre: Float
    radius: Float
    strength: Float


class Status(IntEnum):
    """The status of an interface node in result.h5."""

    BONDED, CLOSED, OPEN = range(3)


@dataclass(frozen=True)
class State:
    """A state, the group /state/K of result.h5.

    Vectors have c = 2 and tensors v = 3 components [11, 22, 12]; in generalized plane strain c = 3 and v = 6, in the
    order [11, 22, 33, 23, 13, 12].  In conduction, displacement 3 is the temperature; stresses [33, 23, 13] are -flux.

    Attributes:
        strain, mean_stress: (v,) macroscopic strain E and stress Sigma.
        point: number of the point in `path` or `angle` of result.json.
        displacement, fluctuation: (n, c) u and u - E x.
        stress, stress_33: (m, v) and (m,) element means.
        traction, jump: (k, c) normal, tangential and axial components.
        status: (k,) values of `Status`.
        damage: (k,) from 0 (intact) to 1 (broken).
        sliding: (k,) slip direction -1 or 1 of sliding nodes, else 0.
        mesh_error: (m,) estimated energy error, relative to the energy of the cell; NaN without an estimate.
    """

    name: str
    strain: Float
    mean_stress: Float
    load_factor: float
    point: int
    displacement: Float
    fluctuation: Float
    stress: Float
    traction: Float
    jump: Float
    status: AnyInt
    damage: Float
    sliding: AnyInt
    mesh_error: Float
    stress_33: Float
    temperature: float

    @property
    def along(self) -> float:
        """Return E33 in generalized plane strain, the gradient along x3 in conduction, and 0 in plane states."""
        return float(self.strain[2]) if len(self.strain) > 3 else 0.0


def gradient(strain: Float) -> Float:
    """Compute the displacement gradient (c, 2) of a strain (v,), symmetric in the plane."""
    E11, E22, gamma12 = strain[[0, 1, -1]]
    plane = [[E11, gamma12 / 2], [gamma12 / 2, E22]]
    return np.array(plane if len(strain) == 3 else [*plane, strain[[4, 3]]])


@dataclass(frozen=True)
class ResultFiles:
    """An open result folder.  `size` (2,) is the size of the cell, `altered` names files changed since the run."""

    document: Section
    size: Float
    phases: tuple[str, ...]
    mesh: Mesh
    interface: InterfaceRows
    fibres: Fibres
    file: h5py.File
    altered: tuple[str, ...]

    @property
    def case(self) -> Mapping[str, Any]:
        """Return the resolved case."""
        case: Mapping[str, Any] = self.document["case"]
        return case

    @property
    def is_spatial(self) -> bool:
        """Return whether the case has generalized plane strain or conduction."""
        return self.case["analysis"]["plane"] in ("generalized", "conduction")

    @property
    def boundary(self) -> str:
        """Return the conditions on the sides: "periodic", "displacement" or "traction"."""
        return str(self.case["cell"].get("boundary", "periodic"))

    @property
    def shift(self) -> Float | None:
        """Return the distance (2,) between periodic images; None without images."""
        return self.size if self.boundary == "periodic" else None

    @property
    def contact(self) -> bool:
        """Return whether debonded faces must not overlap."""
        return any(section.get("contact", False) for section in self.interfaces)

    @property
    def interfaces(self) -> Sequence[Mapping[str, Any]]:
        """Return the sections [[interface]], [] for perfect bonds.  Conductances become axial stiffnesses."""
        sections: Any = self.case.get("interface", [])
        sections = sections if isinstance(sections, list) else [sections]
        return [{"axial_stiffness": row["conductance"], **row} if "conductance" in row else row for row in sections]

    @property
    def points(self) -> Points:
        """Return the points of a path or of angles, the single load, or [] for other analyses."""
        document = self.document
        points: Points = document.get("path") or document.get("angle") or []
        return points or ([document["load"]] if "load" in document else [])

    def states(self) -> Iterator[State]:
        """Yield the states in ascending order, with one state in memory at a time."""
        names = "displacement", "stress", "stress_33", "mesh_error", "traction", "jump", "status", "damage", "sliding"
        for number in sorted(map(int, self.file.get("state", ()))):
            group = self.file[f"state/{number}"]
            attributes, arrays = group.attrs, {name: group[name][()] for name in names}
            if self.is_spatial:
                for name in ("displacement", "traction", "jump"):
                    arrays[name] = np.column_stack([arrays[name], group[f"axial_{name}"]])
                plane, axial = arrays["stress"], group["axial_stress"][()]
                arrays["stress"] = np.column_stack([plane[:, :2], arrays["stress_33"], axial, plane[:, 2]])
            strain, mean = (np.array(attributes[name], float) for name in ("strain", "stress"))
            title, temperature = f"state {number} ({attributes['label']})", float(attributes.get("temperature", 0.0))
            factor, point = float(attributes["load_factor"]), int(attributes["point"])
            x = self.mesh.points - self.mesh.points.min(axis=0)
            arrays["fluctuation"] = arrays["displacement"] - x @ gradient(strain).T
            yield State(title, strain, mean, factor, point, temperature=temperature, **arrays)


def altered(directory: Path) -> tuple[str, ...]:
    """Return the names of files changed since the run.  Raises like `_document`; OSError if result.h5 is unreadable."""
    document, path = _document(directory / JSON), directory / FIELDS
    if not path.is_file():
        has_fields = document["case"].get("output", {}).get("fields", False)
        raise CaseError(f"{path}: {'missing; run the case again (--resume)' if has_fields else MISSING_FIELDS}")
    # `checksum` is the CRC-32 of the text without this last key.
    end = f',\n "checksum": {json.dumps(document.get("checksum"))}\n}}\n'.encode()
    text = input_files.read(directory / JSON).removesuffix(end) + b"\n}"
    unchanged = {JSON: document.get("checksum") == f"{zlib.crc32(text):08x}"}
    seal = document.get("result_h5")
    with input_files.opened(path) as stream:
        size, checksum = os.fstat(stream.fileno()).st_size, 0
        if isinstance(seal, dict) and seal.get("bytes") == size:  # a file with another size need not be read
            blocks = [zlib.crc32(block) for block in iter(partial(stream.read, CHECKSUM_BLOCK), b"")]
            checksum = zlib.crc32(np.array(blocks, "<u4").tobytes())  # the CRC-32 of the CRC-32s of all blocks
    unchanged[FIELDS] = seal == {"bytes": size, "checksum": f"{checksum:08x}"}
    return tuple(name for name, is_unchanged in unchanged.items() if not is_unchanged)


@contextmanager
def opened(directory: Path) -> Iterator[ResultFiles]:
    """Context manager: open a result folder.  Raises like `altered`; OSError or KeyError for a faulty result.h5."""
    changed, path = altered(directory), directory / FIELDS
    with h5py.File(path, "r") as file:
        tables = {
            "mesh": ("points", "triangles", "subdomain", "phase", "body"),
            "interface": ("points", "normal", "length", "fibre_number", "fibre", "pair"),
            "fibre": ("body", "centre", "radius", "strength"),
        }
        mesh, interface, fibres = ([file[f"{part}/{name}"][()] for name in names] for part, names in tables.items())
        size = np.array([file.attrs["width"], file.attrs["height"]], float)
        phases = tuple(map(str, file.attrs["phases"]))
        parts = Mesh(*mesh), InterfaceRows(*interface), Fibres(*fibres), file, changed
        files = ResultFiles(Section(_document(directory / JSON)), size, phases, *parts)
        pairs = {name for section in files.interfaces for name in section.get("between", ())}
        if not pairs <= set(phases):
            raise CaseError(f"{path}: the case has interfaces between unknown phases")
        yield files


def _document(path: Path) -> Mapping[str, Any]:
    """Read result.json.  Raises CaseError for a missing, damaged or older file, FetiHomogError without permission."""
    try:
        document = json.loads(input_files.read(path).decode("utf-8"))
    except OSError as error:
        raise input_files.unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise CaseError(f"cannot read {path}: it is damaged: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA or not isinstance(document.get("case"), dict):
        raise CaseError(f"{path}: no result of this version; expected schema {SCHEMA} and a case")
    return document
