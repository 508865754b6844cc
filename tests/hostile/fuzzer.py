"""Random damage to files of every reader but those of meshes: each is read or refused in lines, in time."""

import json
import shutil
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from support.base_case import BASE, changed
from support.damaged_files import damaged
from support.small_path import PATH
from unit.case.faulty_cases import FAULTY_CASES

from feti_homog.analysis import stored_result
from feti_homog.case import cases
from feti_homog.commands import listed_fibres
from feti_homog.errors import FetiHomogError
from feti_homog.microstructure.fibre_pattern import read_window
from feti_homog.report.cards import export
from feti_homog.report.text.summary import summary
from feti_homog.results import result_json
from feti_homog.studies import case_folders, sweep_cases
from feti_homog.verify.certificate import verify
from hostile.attempts import LIMIT_S, PATIENCE_S
from hostile.fibre_tables import CASE, HEAD
from hostile.job import limit

VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1.5, 1e308, 10**40, "", "x", "\x1b[31m", "\ud800", [], [0], [[]], [None], {}, {"x": 1}),
)
TABLES = (
    HEAD + "".join(f"{x / 7:.3f},{y / 7:.3f},0.05\n" for x in range(6) for y in range(6)),
    "# width: 10; height: 10\nx;y;radius;phase;coating\n2,5;2,5;1;fibre;0,1\n7;7;1,5;void;\n5;2;0,5;fibre:2;0\n",
    "# width=1, height=1, left=0, bottom=0\nx\ty\ta\tb\tangle\n0.5\t0.5\t0.2\t0.1\t30\n0.2\t0.9\t0.1\t0.1\t0\n",
)
DOCUMENTS = (
    BASE,
    PATH,
    CASE,
    changed(
        end='[sweep]\n"cell.fibre_fraction" = {from = 0.1, to = 0.5, step = 0.1}\n"material.fibre.young" = [1, 2]\n'
    ),
    *FAULTY_CASES.values(),
)


def faults(prepared: Path, folder: Path, count: int, seed: int) -> Iterator[str]:
    """Yield those of so many files, half of them tables and cases, half results and sweeps, in a new folder."""
    folder.mkdir()
    (folder / "t.csv").write_text(TABLES[0])
    for name in ("path", "card", "sweep"):
        shutil.copytree(prepared / name, folder / name)
    rng = np.random.default_rng(seed)
    for number in range(count):
        limit(LIMIT_S, PATIENCE_S)
        try:
            KINDS[number % len(KINDS)](prepared, folder, rng)
        except FetiHomogError as error:
            if not all(fault.isprintable() and fault for fault in error.faults):
                yield f"file {number} of seed {seed}: {error.faults}"
        except Exception:
            yield f"file {number} of seed {seed}: {traceback.format_exc()[-1500:]}"
        limit(0, 0)


def _table(_: Path, folder: Path, rng: np.random.Generator) -> None:
    path = folder / "random.csv"
    path.write_bytes(damaged(TABLES[rng.integers(len(TABLES))].encode(), rng))
    read_window(path)


def _case(_: Path, folder: Path, rng: np.random.Generator) -> None:
    path = folder / "random.toml"
    path.write_bytes(damaged(DOCUMENTS[rng.integers(len(DOCUMENTS))].encode(), rng))
    read = sweep_cases.load if b"[sweep]" in path.read_bytes() else cases.load
    read(path)


def _result(prepared: Path, folder: Path, rng: np.random.Generator) -> None:
    """Change the document of a result, with its checksum or without, and read it by one of the commands."""
    name = ("path", "card")[rng.integers(2)]
    _change(prepared / name / "result.json", folder / name / "result.json", rng)
    _readers()[rng.integers(4)](folder / name)


def _readers() -> tuple[Callable[[Path], object], ...]:
    return (
        verify,
        listed_fibres.read,
        lambda directory: export.card(directory, "csv", "orthotropic"),
        lambda directory: summary(stored_result.read(directory)),
    )


def _sweep(prepared: Path, folder: Path, rng: np.random.Generator) -> None:
    _change(prepared / "sweep/sweep.json", folder / "sweep/sweep.json", rng)
    for entry in case_folders.read_index(folder / "sweep").entries:
        case_folders.case_state(folder / "sweep", entry)


def _change(original: Path, path: Path, rng: np.random.Generator) -> None:
    if rng.integers(3) == 0:
        path.write_bytes(damaged(original.read_bytes(), rng))
        return
    document = json.loads(original.read_text())
    place: Any = document
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[rng.integers(len(keys))]
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or rng.integers(4) == 0:
            break
        place = inner
    place[key] = VALUES[rng.integers(len(VALUES))]
    path.write_bytes(result_json.dumps(document).encode("utf-8", "surrogatepass"))


KINDS = (_table, _result, _case, _sweep)
