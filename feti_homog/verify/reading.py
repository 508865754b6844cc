"""The files of a result as arrays: result.json with the resolved case, result.h5 with mesh, interface and states."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from feti_homog.errors import CaseError
from feti_homog.system.runtime import input_files
from feti_homog.typing import Float, Int
from feti_homog.verify.cell_tables import Fibres, InterfaceRows, Mesh, State, gradient
from feti_homog.verify.leaves import Section

JSON, FIELDS = "result.json", "result.h5"
SCHEMA = 1
ROWS = ("points", "normal", "length", "fibre_number", "fibre")
MISSING_FIELDS = "only a run with `fields = true` in [output] can be verified"
BLOCK = 1 << 26  # bytes


@dataclass(frozen=True)
class ResultFiles:
    """A folder of results, opened: result.json, which notes what laws read; the size (2,) of the cell; names of phases.

    `faces` (k, 2) is a node of the mesh on each face of the interface nodes, fibre and matrix; `altered` are the names
    of the files that are not as the run wrote them.
    """

    document: Section
    size: Float
    phases: tuple[str, ...]
    mesh: Mesh
    interface: InterfaceRows
    fibres: Fibres
    faces: Int
    file: h5py.File
    altered: tuple[str, ...]

    @property
    def case(self) -> Mapping[str, Any]:
        """The resolved case."""
        case: Mapping[str, Any] = self.document["case"]
        return case

    @property
    def is_spatial(self) -> bool:
        """Return whether it is one of generalized plane strain."""
        return bool(self.case["analysis"]["plane"] == "generalized")

    @property
    def contact(self) -> bool:
        """Return whether debonded faces must not overlap."""
        return any(section.get("contact", False) for section in self.interfaces)

    @property
    def interfaces(self) -> Sequence[Mapping[str, Any]]:
        """The sections of interfaces; none of perfect bonding."""
        return _interfaces(self.case)

    def states(self) -> Iterator[State]:
        """Yield the states in their order, one in memory at a time."""
        for number in sorted(map(int, self.file.get("state", ()))):
            with _reading(Path(self.file.filename)):
                yield self._state(number)

    def _state(self, number: int) -> State:
        group = self.file[f"state/{number}"]
        n, m, k = len(self.mesh.points), len(self.mesh.triangles), len(self.interface.points)
        shapes = {"displacement": (n, 2), "stress": (m, 3), "stress_33": (m,), "mesh_error": (m,), "status": (k,)}
        shapes |= {"traction": (k, 2), "jump": (k, 2), "damage": (k,), "sliding": (k,)}
        arrays = {name: self._table(number, name, shape) for name, shape in shapes.items()}
        if self.is_spatial:  # with what is along the fibres
            for name, rows in (("displacement", n), ("traction", k), ("jump", k)):
                arrays[name] = np.column_stack([arrays[name], self._table(number, f"axial_{name}", (rows,))])
            plane, along = arrays["stress"], self._table(number, "axial_stress", (m, 2))
            arrays["stress"] = np.column_stack([plane[:, :2], arrays["stress_33"], along, plane[:, 2]])
        strain, mean = (np.array(group.attrs[name], float) for name in ("strain", "stress"))
        v = 6 if self.is_spatial else 3
        _expect(
            strain.shape == mean.shape == (v,), f"/state/{number} has a strain or a stress of another size than {v}"
        )
        label, factor, point = str(group.attrs["label"]), float(group.attrs["load_factor"]), int(group.attrs["point"])
        warmer = float(group.attrs.get("temperature", 0.0))
        arrays["fluctuation"] = arrays["displacement"] - self.mesh.points @ gradient(strain).T
        name = f"state {number} ({label})"
        return State(name, strain, mean, factor, point, **arrays, temperature=warmer)

    def _table(self, number: int, name: str, shape: tuple[int, ...]) -> Any:
        """Return a table of a state, of the shape that it must have."""
        array = _rows(self.file[f"state/{number}/{name}"])
        _expect(array.shape == shape, f"/state/{number}/{name} has shape {array.shape}, expected {shape}")
        return array


def altered(directory: Path) -> tuple[str, ...]:
    """Names of the files that are not as the run wrote them; CaseError, one line, if one cannot be read."""
    document, path = _document(directory / JSON), directory / FIELDS
    if not path.is_file():
        asked = document["case"].get("output", {}).get("fields", False)
        reason = "it is missing; run the case again" if asked else MISSING_FIELDS
        raise CaseError(f"{path}: {reason}")
    with _reading(path):
        holds = {JSON: is_as_written(document), FIELDS: has_seal(path, document.get("result_h5"))}
    return tuple(name for name, as_written in holds.items() if not as_written)


@contextmanager
def opened(directory: Path) -> Iterator[ResultFiles]:
    """Provide the results in a folder, while the block lasts; CaseError, one line, if they cannot be read."""
    changed, path = altered(directory), directory / FIELDS
    with _reading(path):
        file = h5py.File(path, "r")
    with file:
        with _reading(path):
            files = _contents(_document(directory / JSON), file, changed)
        yield files


def _document(path: Path) -> Mapping[str, Any]:
    try:
        document = json.loads(input_files.read(path).decode("utf-8"))
    except OSError as error:
        raise input_files.unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise CaseError(f"cannot read {path}: it is damaged: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA or not isinstance(document.get("case"), dict):
        raise CaseError(f"{path}: is no result of this version: expected schema {SCHEMA} and a case")
    return document


def _contents(document: Mapping[str, Any], file: h5py.File, altered: tuple[str, ...]) -> ResultFiles:
    """Return the whole of both files but the states."""
    mesh = Mesh(*(_rows(file[f"mesh/{name}"]) for name in ("points", "triangles", "subdomain", "phase", "body")))
    own, of_fibre = file["interface"], file["fibre"]
    # Results of before there were several sections have no pairs, of before bonds could scatter no strengths.
    pair = _rows(own["pair"]) if "pair" in own else np.zeros(len(own["points"]), np.int32)
    rows = InterfaceRows(*[*(_rows(own[name]) for name in ROWS), pair])
    strength = _rows(of_fibre["strength"]) if "strength" in of_fibre else np.ones(len(of_fibre["number"]))
    fibres = Fibres(*[*(_rows(of_fibre[name]) for name in ("number", "body", "phase", "centre", "radius")), strength])
    faces = np.stack([_rows(own[name]) for name in ("fibre_node", "matrix_node")], axis=1)
    size = np.array([file.attrs["width"], file.attrs["height"]], float)
    phases, sections = tuple(map(str, file.attrs["phases"])), _interfaces(document["case"])
    _expect_shapes(mesh, rows, fibres, faces)
    for name, table, low, high in (
        ("/mesh/triangles names unknown nodes", mesh.triangles, 0, len(mesh.points)),
        ("/mesh/phase names unknown phases", mesh.phase, 0, len(phases)),
        ("/interface/pair names unknown interfaces", rows.pair, 0, max(len(sections), 1)),
        ("/interface names unknown nodes", faces, 0, len(mesh.points)),
        ("/interface/fibre_number names unknown fibres", rows.fibre, 1, len(fibres.radius) + 1),
    ):
        _expect(bool(((table >= low) & (table < high)).all()), name)
    named = {name for section in sections for name in section.get("between", ())}
    _expect(named <= set(phases), "the case has interfaces between unknown phases")
    return ResultFiles(Section(document), size, phases, mesh, rows, fibres, faces, file, altered)


def _expect_shapes(mesh: Mesh, rows: InterfaceRows, fibres: Fibres, faces: Int) -> None:
    n, m, k, f = len(mesh.points), len(mesh.triangles), len(rows.points), len(fibres.radius)
    columns = 6 if mesh.triangles.shape[1:] == (6,) else 3
    tables = {
        "/mesh/points": (mesh.points, (n, 2)), "/mesh/triangles": (mesh.triangles, (m, columns)),
        **{f"/mesh/{name}": (getattr(mesh, name), (m,)) for name in ("subdomain", "phase", "body")},
        "/interface/points": (rows.points, (k, 2)), "/interface/normal": (rows.normal, (k, 2)),
        **{f"/interface/{name}": (getattr(rows, name), (k,)) for name in ("length", "fibre", "body", "pair")},
        "/interface/fibre_node": (faces, (k, 2)), "/fibre/centre": (fibres.centre, (f, 2)),
        **{f"/fibre/{name}": (getattr(fibres, name), (f,)) for name in ("body", "phase", "strength")},
    }  # fmt: skip
    for name, (table, shape) in tables.items():
        _expect(table.shape == shape and n > 0 and m > 0, f"{name} has shape {table.shape}, expected {shape}")


def _interfaces(case: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    sections = case.get("interface", [])
    return sections if isinstance(sections, list) else [sections]


def _rows(table: h5py.Dataset) -> Any:
    return np.asarray(table[()])


def _expect(holds: bool, fault: str) -> None:
    if not holds:
        raise ValueError(fault)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Convert errors of reading a damaged or foreign file into one line."""
    try:
        yield
    except OSError as error:
        raise input_files.unreadable(path, error) from error
    except (AttributeError, RuntimeError, KeyError, ValueError, TypeError) as error:
        words = error.args[0] if error.args else error
        raise CaseError(f"cannot read {path}: {' '.join(str(words).split())}") from error


def is_as_written(document: Mapping[str, Any]) -> bool:
    """Return whether `checksum` in result.json is the CRC-32 of the rest, in the layout in which it is written."""
    content = {key: value for key, value in document.items() if key != "checksum"}
    text = json.dumps(content, indent=1, ensure_ascii=False)
    return bool(document.get("checksum") == f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}")


def has_seal(path: Path, seal: object) -> bool:
    """Return whether a file has its size and the CRC-32 of the CRC-32s of its blocks, `result_h5` of result.json.

    Raises:
        OSError: it cannot be read.
    """
    with input_files.opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if not isinstance(seal, dict) or seal.get("bytes") != size:
            return False
        checksums = [zlib.crc32(block) for block in iter(partial(stream.read, BLOCK), b"")]
    whole = zlib.crc32(np.array(checksums, "<u4").tobytes())
    return seal == {"bytes": size, "checksum": f"{whole:08x}"}
