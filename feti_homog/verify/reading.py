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

JSON, FIELDS = "result.json", "result.h5"
SCHEMA = 1
# Tables of a state that follow from others: rows of elements or of interface nodes, and columns.
DERIVED: dict[str, tuple[Any, ...]] = {
    "stress_33": ("m",),
    "traction_vector": ("k", 3), "jump_vector": ("k", 3),
    "displacement_fibre": ("k", 3), "displacement_matrix": ("k", 3),
}  # fmt: skip
# In generalized plane strain stresses 33 are among the stresses.
SPATIAL_DERIVED = {name: shape for name, shape in DERIVED.items() if name != "stress_33"}
ROWS = ("points", "normal", "length", "fibre_number", "fibre")
MISSING_FIELDS = "only a run with `fields = true` in [output] can be verified"
BLOCK = 1 << 26  # bytes


@dataclass(frozen=True)
class ResultFiles:
    """A folder of results, opened.

    Attributes:
        document: result.json.
        size: (2,) width and height of the cell.
        phases: names of the phases, the matrix first.
        faces: (k, 2) a node of the mesh on each face of the interface nodes, fibre and matrix.
        altered: names of the files that are not as the run wrote them.
    """

    document: Mapping[str, Any]
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
        basic = {"displacement": (n, 2), "stress": (m, 3), "traction": (k, 2), "jump": (k, 2), "status": (k,)}
        shown = SPATIAL_DERIVED if self.is_spatial else DERIVED
        derived = {name: (m if of == "m" else k, *columns) for name, (of, *columns) in shown.items()}
        arrays, others = (
            {name: self._table(number, name, shape) for name, shape in shapes.items()} for shapes in (basic, derived)
        )
        if self.is_spatial:
            arrays |= self._spatial(number, arrays)
        # Older results have no damage, nothing that slides, and no estimated errors.
        missing = (arrays["status"] != 0).astype(float), np.zeros(k, np.int8), np.full(m, np.nan)
        for name, old in zip(("damage", "sliding", "mesh_error"), missing, strict=True):
            arrays[name] = self._table(number, name, old.shape) if name in group else old
        strain, mean = (np.array(group.attrs[name], float) for name in ("strain", "stress"))
        v = 6 if self.is_spatial else 3
        _expect(
            strain.shape == mean.shape == (v,), f"/state/{number} has a strain or a stress of another size than {v}"
        )
        label, factor, point = str(group.attrs["label"]), float(group.attrs["load_factor"]), int(group.attrs["point"])
        warmer = float(group.attrs["temperature"]) if self.is_spatial else 0.0
        arrays["fluctuation"] = arrays["displacement"] - self.mesh.points @ gradient(strain).T
        name = f"state {number} ({label})"
        return State(name, strain, mean, factor, point, **arrays, derived=others, temperature=warmer)

    def _spatial(self, number: int, plane: Mapping[str, Float]) -> dict[str, Float]:
        """Return the tables of a state with what is along the fibres."""
        rows = {"displacement": "n", "traction": "k", "jump": "k"}
        count = {"n": len(self.mesh.points), "k": len(self.interface.points)}
        whole = {
            name: np.column_stack([plane[name], self._table(number, f"axial_{name}", (count[of],))])
            for name, of in rows.items()
        }
        m = len(self.mesh.triangles)
        S33, (S23, S13) = self._table(number, "stress_33", (m,)), self._table(number, "axial_stress", (m, 2)).T
        S11, S22, S12 = plane["stress"].T
        return whole | {"stress": np.column_stack([S11, S22, S33, S23, S13, S12])}

    def _table(self, number: int, name: str, shape: tuple[int, ...]) -> Any:
        """Return a table of a state, of the shape that it must have."""
        array = _rows(self.file[f"state/{number}/{name}"])
        _expect(array.shape == shape, f"/state/{number}/{name} has shape {array.shape}, expected {shape}")
        return array


def altered(directory: Path) -> tuple[str, ...]:
    """Names of the files of a result that are not as the run wrote them, by their checksums.

    Raises:
        CaseError: one is missing or cannot be read; one line.
    """
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
    """Provide the results in a folder, while the block lasts.

    Raises:
        CaseError: there are none that can be read; one line.
    """
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
    own = file["interface"]
    # Results of before there were several sections have no pairs.
    pair = _rows(own["pair"]) if "pair" in own else np.zeros(len(own["points"]), np.int32)
    points, normal, length, number, body = (_rows(own[name]) for name in ROWS)
    rows = InterfaceRows(points, normal, length, number, body, pair)
    fibres = _fibres(file["fibre"])
    faces = np.stack([_rows(file[f"interface/{name}"]) for name in ("fibre_node", "matrix_node")], axis=1)
    size = np.array([file.attrs["width"], file.attrs["height"]], float)
    phases = tuple(map(str, file.attrs["phases"]))
    n, m, k = len(mesh.points), len(mesh.triangles), len(rows.points)
    _expect(mesh.points.shape == (n, 2) and n > 0, "/mesh/points is no table of positions")
    _expect(mesh.triangles.shape in ((m, 3), (m, 6)) and m > 0, "/mesh/triangles is no table of triangles")
    _expect(bool((mesh.triangles >= 0).all() and (mesh.triangles < n).all()), "/mesh/triangles names unknown nodes")
    _expect(
        mesh.subdomain.shape == mesh.phase.shape == mesh.body.shape == (m,),
        "/mesh has labels of another number of elements",
    )
    _expect(bool((mesh.phase >= 0).all() and (mesh.phase < len(phases)).all()), "/mesh/phase names unknown phases")
    lengths = {table.shape for table in (rows.length, rows.fibre, rows.body, rows.pair)}
    alike = rows.points.shape == rows.normal.shape == faces.shape == (k, 2) and lengths == {(k,)}
    _expect(alike, "/interface has tables of different lengths")
    _expect_known_pairs(_interfaces(document["case"]), rows, phases)
    _expect(bool((faces >= 0).all() and (faces < n).all()), "/interface names unknown nodes")
    within = (rows.fibre >= 1) & (rows.fibre <= len(fibres.radius))
    _expect(bool(within.all()), "/interface/fibre_number names unknown fibres")
    return ResultFiles(document, size, phases, mesh, rows, fibres, faces, file, altered)


def _fibres(own: h5py.Group) -> Fibres:
    number, body, phase, centre, radius = (_rows(own[name]) for name in ("number", "body", "phase", "centre", "radius"))
    # Results of before bonds could scatter have no strengths.
    strength = _rows(own["strength"]) if "strength" in own else np.ones(len(number))
    fibres = Fibres(number, body, phase, centre, radius, strength)
    lengths = {table.shape for table in (fibres.body, fibres.radius, fibres.strength)}
    alike = len(lengths) == 1 and fibres.centre.shape == (len(fibres.radius), 2)
    _expect(alike, "/fibre has tables of different lengths")
    return fibres


def _expect_known_pairs(sections: Sequence[Mapping[str, Any]], rows: InterfaceRows, phases: tuple[str, ...]) -> None:
    known = (rows.pair >= 0) & (rows.pair < max(len(sections), 1))
    _expect(bool(known.all()), "/interface/pair names unknown interfaces")
    named = {name for section in sections for name in section.get("between", ())}
    _expect(named <= set(phases), "the case has interfaces between unknown phases")


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
