"""Random damage to files of every reader: bytes, numbers and entries, the latter two under right checksums."""

import json
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from PIL import Image
from support.base_case import BASE, MESH_CELL, changed
from support.damaged_files import damaged
from support.label_images import circles_in_pixels
from support.small_path import PATH
from unit.case.faulty_cases import FAULTY_CASES
from unit.mesh.readers.test_damaged_files import SEEDS

from feti_homog.results import checkpoints, result_json
from hostile.attempts import Attempt, Content, copy_of
from hostile.events import in_events
from hostile.fibre_tables import CASE, HEAD
from hostile.results import COMMANDS, PREPARED, SMALL, resealed, with_tables

VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1.5, 1e308, 10**40, "", "x", "\x1b[31m", "\ud800", [], [0], [[]], [None], {}, {"x": 1}),
)
NUMBERS = (0, 1, -1, 2, 3, 7, 77, 2**31 - 1, -(2**31), 2**40, 1e-300, 0.5, 1e30, 1e100, 1e308, np.inf, -np.inf, np.nan)
TEXTS = ("", "x" * 3000, "\x1b[31m", r"$\frac", "\n", "a/../b")
TABLES = (
    HEAD + "".join(f"{x / 7:.3f},{y / 7:.3f},0.05\n" for x in range(6) for y in range(6)),
    "# width: 10; height: 10\nx;y;radius;phase;coating\n2,5;2,5;1;fibre;0,1\n7;7;1,5;void;\n5;2;0,5;fibre:2;0\n",
    "# width=1, height=1, left=0, bottom=0\nx\ty\ta\tb\tangle\n0.5\t0.5\t0.2\t0.1\t30\n0.2\t0.9\t0.1\t0.1\t0\n",
)
SWEEP = '[sweep]\n"cell.fibre_fraction" = {from = 0.1, to = 0.5, step = 0.1}\n"material.fibre.young" = [1, 2]\n'
DOCUMENTS = (BASE, PATH, CASE, changed(end=SWEEP), *FAULTY_CASES.values())
FIT = PATH.replace("normal_strength = 4.0", "normal_strength = 5.0") + (
    "[unknown]\ninterface.normal_strength = {start = 4.0, lower = 1.0, upper = 20.0}\n"
    '[measured]\ncurve = {file = "t.csv", std = 0.01}\n'
)
CURVE = "E11,S11\n" + "".join(f"{k / 100},{k / 40:.3f}\n" for k in range(1, 20))
OPTIONS = "# of the solver\n-feti_ksp_rtol 1e-9\n-feti_ksp_type cg\n-feti_ksp_max_it 500 # no more\n-feti_view false\n"
Case = tuple[tuple[str, ...], dict[str, Content]]


def attempts(prepared: Path, count: int, seed: int) -> Iterator[Attempt]:
    """Yield `count` damaged inputs; the kinds take turns, so that jobs with every other input have all kinds."""
    rng, kinds = np.random.default_rng(seed), list(KINDS.items())
    for number in range(count):
        kind, make = kinds[(number + number // len(kinds)) % len(kinds)]
        words, files = make(prepared, rng)
        yield Attempt(f"random {kind}", f"{number} of seed {seed}", words, "", files, (0, 2, 3))


def _choice(entries: Any, rng: np.random.Generator) -> Any:
    return entries[rng.integers(len(entries))]


def _table(_: Path, rng: np.random.Generator) -> Case:
    return ("fibres", "@/c.toml"), {"c.toml": CASE, "t.csv": damaged(_choice(TABLES, rng).encode(), rng)}


def _case(_: Path, rng: np.random.Generator) -> Case:
    content = damaged(_choice(DOCUMENTS, rng).encode(), rng)
    words = ("sweep", "@/c.toml", "--list") if b"[sweep]" in content else ("fibres", "@/c.toml")
    return words, {"c.toml": content, "t.csv": TABLES[0]}


def _curve(_: Path, rng: np.random.Generator) -> Case:
    return ("check", "@/c.toml"), {"c.toml": FIT, "t.csv": damaged(CURVE.encode(), rng)}


def _options(_: Path, rng: np.random.Generator) -> Case:
    words = "check", "@/c.toml", "-options_file", "@/options"
    return words, {"c.toml": SMALL, "options": damaged(OPTIONS.encode(), rng)}


@cache
def _meshes() -> dict[str, bytes]:
    """Return sound mesh files of every format by name."""
    with tempfile.TemporaryDirectory() as folder:
        paths = {name: Path(folder) / name for name in SEEDS}
        for name, write in SEEDS.items():
            write(paths[name])
        return {name: path.read_bytes() for name, path in paths.items()}


def _mesh(_: Path, rng: np.random.Generator) -> Case:
    name = _choice([*SEEDS], rng)
    case = changed((MESH_CELL[0], f'geometry = "mesh"\nfile = "{name}"'))
    return ("check", "@/c.toml"), {"c.toml": case, name: damaged(_meshes()[name], rng)}


@cache
def _images() -> dict[str, bytes]:
    """Return sound label images of every format by name."""
    image, streams = circles_in_pixels(12), {name: BytesIO() for name in ("a.png", "a.tif", "a.npy", "a.npz")}
    for name in ("a.png", "a.tif"):
        Image.fromarray(image).save(streams[name], {"a.png": "PNG", "a.tif": "TIFF"}[name])
    np.save(streams["a.npy"], image)
    np.savez_compressed(streams["a.npz"], image)
    return {name: stream.getvalue() for name, stream in streams.items()}


def _image(_: Path, rng: np.random.Generator) -> Case:
    name = _choice([*_images()], rng)
    cell = f'geometry = "pixels"\nfile = "{name}"\npixel = 1.0\nlabels = {{0 = "matrix", 1 = "fibre"}}'
    return ("check", "@/c.toml"), {"c.toml": changed((MESH_CELL[0], cell)), name: damaged(_images()[name], rng)}


def _document(prepared: Path, rng: np.random.Generator) -> Case:
    """Change the document of a result, with its checksum or without."""
    source = prepared / _choice(("path", "card"), rng)
    words = _choice([words for name, words in COMMANDS.items() if name != "collect"], rng)
    return words, {"out": copy_of(source, result_json=_changed_document(source / "result.json", rng))}


def _sweep(prepared: Path, rng: np.random.Generator) -> Case:
    content = _changed_document(prepared / "sweep/sweep.json", rng)
    words = *COMMANDS["collect"], *(("--no-pictures",) if rng.integers(3) else ())
    return words, {"out": copy_of(prepared / "sweep", sweep_json=content)}


def _changed_document(original: Path, rng: np.random.Generator) -> bytes:
    if rng.integers(3) == 0:
        return damaged(original.read_bytes(), rng)
    document = json.loads(original.read_text())
    place: Any = document
    while True:
        key = _choice(list(place) if isinstance(place, dict) else list(range(len(place))), rng)
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or rng.integers(4) == 0:
            break
        place = inner
    place[key] = _choice(VALUES, rng)
    return result_json.dumps(document).encode("utf-8", "surrogatepass")


def _fields(prepared: Path, rng: np.random.Generator) -> Case:
    """Change numbers and texts of result.h5, or its bytes, and renew its checksum."""
    state = ("plot", "@/out", "--state", "0", "--size", "9x9")
    words = _choice((state, state, COMMANDS["plot"], COMMANDS["report"], COMMANDS["verify"], ("fields", "@/out")), rng)
    seed, is_raw = int(rng.integers(2**31)), rng.integers(4) == 0
    stream = np.random.default_rng(seed)
    change = resealed(lambda path: path.write_bytes(damaged(path.read_bytes(), stream))) if is_raw else None
    change = change or with_tables(lambda file: _change_tables(file, stream))
    return words, {"out": copy_of(prepared / _choice(("path", "card"), rng), result_h5=change)}


def _change_tables(file: h5py.File, rng: np.random.Generator) -> None:
    """Damage one to three tables or attributes: replace numbers, or exchange rows.  Types stay."""
    tables, groups = list[h5py.Dataset](), [file["/"], *file.get("state", {}).values()]
    file.visititems(lambda _, entry: tables.append(entry) if isinstance(entry, h5py.Dataset) and entry.size else None)
    for _ in range(rng.integers(1, 4)):
        if rng.integers(4) == 0:
            attributes = _choice(groups, rng).attrs
            name = _choice([*attributes], rng)
            values = np.asarray(attributes[name])
            other = np.full(values.shape, _choice(TEXTS, rng), object) if values.dtype.kind in "OU" else None
            attributes[name] = _moved(values, rng) if other is None else other if values.ndim else str(other)
        else:
            table = _choice([table for table in tables if not table.is_virtual], rng)
            table[...] = _moved(table[()], rng)


def _moved(values: Any, rng: np.random.Generator) -> Any:
    """Return an array with one, some or all numbers or rows changed."""
    rows = np.array(values.reshape(-1, *values.shape[1:]))
    limits = np.iinfo(rows.dtype) if rows.dtype.kind in "iu" else None
    with np.errstate(over="ignore"):
        number = _choice([n for n in NUMBERS if limits is None or (n == round(n) if np.isfinite(n) else False)], rng)
        number = number if limits is None else int(np.clip(number, limits.min, limits.max))
        number = np.array(number).astype(rows.dtype)
    kind = rng.integers(5)
    if kind == 0:
        rows.ravel()[rng.integers(rows.size)] = number
    elif kind == 1:
        rows[rng.random(len(rows)) < 0.3] = number
    elif kind == 2:
        rows[...] = number
    elif kind == 3:
        rows = rows[rng.permutation(len(rows))]
    else:
        rows[rng.integers(len(rows))] = rows[rng.integers(len(rows))]
    return rows.reshape(values.shape)


def _events(prepared: Path, rng: np.random.Generator) -> Case:
    """Change numbers of an event of a checkpoint, or the bytes of all."""
    stream, is_raw = np.random.default_rng(int(rng.integers(2**31))), rng.integers(3) == 0

    def falsify(events: list[checkpoints.Arrays]) -> None:
        event = _choice(events, stream)
        name = _choice([name for name, array in event.items() if array.size and array.dtype.kind in "fiu"], stream)
        event[name] = _moved(event[name], stream)

    def damage(path: Path) -> None:
        path.write_bytes(damaged(path.read_bytes(), stream))

    changes: dict[str, Content] = {"checkpoint/events": damage if is_raw else in_events(falsify)}
    words = _choice((("run", "@/c.toml", "--out", "@/out", "--resume"), COMMANDS["plot"]), rng)
    copy = copy_of(prepared / "unfinished", result_json=lambda path: path.unlink(), **changes)
    return words, {"c.toml": PREPARED["unfinished"][1], "out": copy}


KINDS: dict[str, Callable[[Path, np.random.Generator], Case]] = {
    "tables": _table,
    "documents": _document,
    "cases": _case,
    "fields": _fields,
    "meshes": _mesh,
    "events": _events,
    "images": _image,
    "sweeps": _sweep,
    "curves": _curve,
    "options": _options,
}
