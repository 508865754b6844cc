"""Folders of results and of sweeps, and what stands in the place of --out."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from support.base_case import changed
from support.small_path import PATH

from feti_homog.results import result_json
from hostile.attempts import Attempt, Content, copy_of

SMALL = changed(
    ("mesh_size = 0.05", "mesh_size = 0.3"), ('"strain"', '"generalized"'), end="[output]\npictures = false\n"
)
PREPARED = {
    "path": ("run", PATH),
    "unfinished": ("run", PATH.replace("[path]\n", "[path]\nmax_events = 3\n")),
    "card": ("run", SMALL),
    "sweep": ("sweep", SMALL + '[sweep]\n"cell.fibre_fraction" = [0.2, 0.3]\n'),
}
"""Folders that attempts copy and damage: the command that makes each, and its case."""

COMMANDS = {
    "plot": ("plot", "@/out"),
    "report": ("report", "@/out"),
    "verify": ("verify", "@/out"),
    "export": ("export", "@/out", "--format", "abaqus", "--out", "@/out/card.inp"),
    "fibres": ("fibres", "@/out"),
    "collect": ("collect", "@/out"),
}
READERS = ("plot", "report", "verify")


def link_to(target: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.unlink(missing_ok=True)
        path.symlink_to(target)

    return make


def replaced(make: Callable[[Path], object]) -> Callable[[Path], None]:
    def remake(path: Path) -> None:
        path.unlink(missing_ok=True)
        make(path)

    return remake


def sparse(path: Path) -> None:
    os.truncate(path, 20 << 30)


def sealed(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    """Return a function that changes a document and renews its checksum."""

    def make(path: Path) -> None:
        document = json.loads(path.read_text())
        change(document)
        path.write_text(result_json.dumps(document))

    return make


def without(*names: str) -> Callable[[Path], None]:
    return sealed(lambda document: [document.pop(name) for name in names])


def with_entries(**entries: Any) -> Callable[[Path], None]:
    return sealed(lambda document: document.update(entries))


def in_case(**sections: Any) -> Callable[[Path], None]:
    return sealed(lambda document: document["case"].update(sections))


def nested(depth: int) -> str:
    return f'{{"schema": 1, "version": "", "solver": {{}}, "case": {"[" * depth}{"]" * depth}}}'


JSON: dict[str, tuple[Content, str]] = {
    "a pipe": (replaced(os.mkfifo), "it is a pipe"),
    "a folder": (replaced(os.mkdir), "Is a directory"),
    "endless": (link_to("/dev/zero"), "it is a device, not a file"),
    "a link in a circle": (link_to("result.json"), "Too many levels of symbolic links"),
    "sparse": (sparse, "more than 1024 MiB"),
    "empty": ("", "cannot read"),
    "zeros": (b"\0" * 1000, "cannot read"),
    "not UTF-8": (b"\xff" * 1000, "cannot read"),
    "nested": ("[" * 100_000, "cannot read"),
    "nested and closed": (nested(100_000), "cannot read"),
    "nested 900 deep": (nested(900), ""),
    "a number of a megabyte": ("1" * 1_000_000, "cannot read"),
    "a list": ("[]", ""),
    "another layout": (with_entries(schema=[]), "schema"),
    "no case": (without("case"), ""),
    "a case of text": (with_entries(case="\x1b[31m"), ""),
    "no interface": (in_case(interface=None), ""),
    "an output of text": (in_case(output="\x1b[31m"), ""),
    "no output": (sealed(lambda document: document["case"].pop("output")), ""),
    "a material without constants": (in_case(material={"matrix": {}}), ""),
    "another analysis": (in_case(analysis={"type": "envelope", "plane": "strain"}), ""),
    "no path": (without("path"), ""),
    "a path of text": (with_entries(path="\x1b[31m"), ""),
    "a path of nothing": (with_entries(path=[{}]), ""),
    "fibres of text": (with_entries(fibres="\x1b[31m"), ""),
    "a cell of numbers": (with_entries(cell=17), ""),
    "a status of control characters": (with_entries(status="\x1b[31m"), ""),
}
FIELDS: dict[str, tuple[Content, str]] = {
    "a pipe": (replaced(os.mkfifo), ""),
    "a folder": (replaced(os.mkdir), ""),
    "endless": (link_to("/dev/zero"), ""),
    "a link in a circle": (link_to("result.h5"), ""),
    "sparse": (sparse, ""),
    "empty": ("", ""),
    "cut off": (lambda path: os.truncate(path, path.stat().st_size // 2), ""),
    "text": ("\x1b[31m" * 1000, ""),
}


def resealed(change: Callable[[Path], object]) -> Callable[[Path], None]:
    """Return a function that changes result.h5 in a folder, and renews its checksum."""

    def make(path: Path) -> None:
        change(path)
        sealed(lambda document: document.update(result_h5=asdict(result_json.seal(path))))(
            path.with_name("result.json")
        )

    return make


def with_tables(change: Callable[[h5py.File], object]) -> Callable[[Path], None]:
    """Return a function that changes tables of result.h5 in a folder, and renews its checksum."""

    def make(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            change(file)

    return resealed(make)


def in_place(name: str, make: Callable[[h5py.File, str], object]) -> Callable[[Path], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        make(file, name)

    return with_tables(change)


def virtual(file: h5py.File, name: str) -> None:
    layout = h5py.VirtualLayout((4, 3), "f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "a", (4, 3))
    file.create_virtual_dataset(name, layout)


STRESS, NO_RESULT = "state/0/stress", "no result"
TABLES: dict[str, Callable[[Path], None]] = {
    "a link to a pipe": in_place(STRESS, lambda f, name: f.__setitem__(name, h5py.ExternalLink("pipe", "/a"))),
    "a link to itself": in_place(STRESS, lambda f, name: f.__setitem__(name, h5py.SoftLink(f"/{name}"))),
    "a circle of groups": with_tables(lambda f: f.__setitem__("state/0/up", f["state"])),
    "raw data of others": in_place(
        STRESS, lambda f, name: f.create_dataset(name, (9, 3), "f8", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    ),
    "views of others": in_place(STRESS, virtual),
    "1e15 points": in_place("mesh/points", lambda f, name: f.create_dataset(name, (10**15, 2), "f8", chunks=(999, 2))),
    "tables without data": in_place("mesh/points", lambda f, name: f.create_dataset(name, (10**9, 2), "f8")),
    "2000 hard links": with_tables(lambda f: [f.__setitem__(f"state/x{k}", f["state/0"]) for k in range(2000)]),
    "texts": in_place(STRESS, lambda f, name: f.create_dataset(name, (9, 3), h5py.string_dtype())),
}


def tables_with(name: str, value: Any) -> Callable[[Path], None]:
    """Return a function that replaces a table, or its last number."""

    def change(file: h5py.File) -> None:
        if isinstance(value, np.ndarray):
            del file[name]
            file[name] = value
        else:
            file[name][(-1,) * file[name].ndim] = value

    return with_tables(change)


LAYOUT: dict[str, tuple[Callable[[Path], None], str]] = {
    "a scalar": (tables_with("mesh/points", np.array(0.0)), "/mesh/points is float64 (), expected float64 (0, 2)"),
    "another shape": (tables_with(STRESS, np.zeros((9, 3))), "/state/0/stress is float64 (9, 3), expected float64 ("),
    "another type": (tables_with("mesh/phase", np.zeros(9)), "/mesh/phase is float64 (9,), expected int32 ("),
    "half a precision": (tables_with("fibre/radius", np.zeros(1, "f2")), "/fibre/radius is float16 (1,), expected"),
    "no state 0": (with_tables(lambda f: f.move("state/0", "state/x")), "cannot read"),
    "an unknown node": (tables_with("mesh/triangles", 10**9), "/mesh/triangles has the number 1e+09, expected 0 to"),
    "a node nowhere": (tables_with("mesh/points", np.nan), "/mesh/points has the number nan, expected"),
    "a large displacement": (tables_with("state/0/displacement", 1e308), "/displacement has the number 1e+308"),
}


def attribute_with(value: Any) -> Callable[[Path], None]:
    """Return a function that replaces the case in result.h5."""
    return with_tables(lambda f: f.attrs.__setitem__("case", value))


LAYOUT |= {
    "a case of numbers": (attribute_with(np.zeros(3)), "/case is float64 (3,), expected text ()"),
    "no case": (attribute_with("{}"), "the case in it is damaged: [cell]: missing section"),
    "a nested case": (attribute_with("[" * 60_000), "nested too deeply"),
}
SWEEPS: dict[str, tuple[Content, str]] = {
    "a pipe": (replaced(os.mkfifo), "it is a pipe"),
    "endless": (link_to("/dev/zero"), "it is a device, not a file"),
    "empty": ("", "is damaged"),
    "nested": ("[" * 100_000, "is damaged"),
    "no cases": (without("cases"), "is damaged"),
    "cases of text": (with_entries(cases="\x1b[31m"), "is damaged"),
    "cases of nothing": (with_entries(cases=[{}]), "is damaged"),
    "folders above": (sealed(lambda d: [case.update(folder="../../..") for case in d["cases"]]), "is damaged"),
    "a name of control characters": (with_entries(name="\x1b[31m"), ""),
}
HARMLESS = ("no path", "a status of control characters")  # commands that do not need it go on
OUTS: dict[str, tuple[str, Mapping[str, Content], str]] = {
    "a pipe": ("@/out", {"out": os.mkfifo}, "is a file"),
    "a nested result": ("@/out", {"out/result.json": nested(100_000)}, "no run of this program wrote result.json"),
    "of the system": ("/proc/1", {}, ""),
    "a lock elsewhere": ("@/out", {"mine": "mine", "out/result.lock": link_to("../mine")}, "result.lock is a link"),
    "a checkpoint elsewhere": ("@/out", {"out/checkpoint": link_to("/etc")}, "checkpoint is a link"),
}


def of_layout(prepared: Path) -> Iterator[Attempt]:
    """Yield attempts on tables of right checksums."""
    for name, (make, expected) in LAYOUT.items():
        for command in ("plot", "verify", "fields"):
            files = {"out": copy_of(prepared / "path", result_h5=make)}
            yield Attempt("layout of fields", f"{name}, {command}", (command, "@/out"), expected, files, (2,))


def attempts(prepared: Path) -> Iterator[Attempt]:
    """Yield those that damage copies of the `PREPARED` folders."""
    for name, (content, expected) in JSON.items():
        for command in READERS if name in ("a pipe", "endless", "a link in a circle") or "nested" in name else COMMANDS:
            if command == "collect" or (command == "plot" and name == HARMLESS[1]):  # no picture has it
                continue
            files = {"out": copy_of(prepared / "path", result_json=content)}
            words = COMMANDS[command]
            if command == "plot" and name in HARMLESS:
                words += ("--state", "0")  # of many
            codes = (0, 2, 3) if name in HARMLESS else (2, 3) if command == "verify" else (2,)
            yield Attempt("result.json", f"{name}, {command}", words, expected, files, codes)
    for name, (content, expected) in FIELDS.items():
        for command in READERS:
            files = {"out": copy_of(prepared / "path", result_h5=content)}
            yield Attempt("result.h5", f"{name}, {command}", COMMANDS[command], expected, files, (2, 3))
    for name, make in TABLES.items():
        for command in ("plot", "report", "verify", "fields"):
            files = {"pipe": os.mkfifo, "out": copy_of(prepared / "path", result_h5=make)}
            yield Attempt("tables of fields", f"{name}, {command}", (command, "@/out"), NO_RESULT, files, (2,))
    yield from of_layout(prepared)
    files = {"out": copy_of(prepared / "path", path_csv=link_to("/dev/zero"))}
    yield Attempt("tables of points", "endless, which is none", COMMANDS["verify"], "", files, (0,))
    for name, (content, expected) in SWEEPS.items():
        files = {"out": copy_of(prepared / "sweep", sweep_json=content)}
        yield Attempt("sweeps", name, COMMANDS["collect"], expected, files, (2,) if expected else (0,))
    for name, (out, files, expected) in OUTS.items():
        yield Attempt("folders", name, ("run", "@/c.toml", "--out", out), expected, {"c.toml": SMALL, **files})
    for command, words in COMMANDS.items():
        yield Attempt("no results", command, words, "")
