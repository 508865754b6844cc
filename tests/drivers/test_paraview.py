"""ParaView itself, where there is one: each of its three readers of XDMF sees the values of result.h5."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from support.cases import FIBRE, MATRIX
from support.jobs import PATIENCE

from feti_homog import Case, run
from feti_homog.results import xdmf

SCRIPT = Path(__file__).parents[2] / "scripts" / "paraview_check.py"
CASE = {
    "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.25, "order": 2},
    "material": {"matrix": MATRIX, "fibre": FIBRE},
    "analysis": {"type": "angle", "plane": "strain"},
    "interface": {"debonded": [{"fibre": "all"}]},
    "angle": {"values": [0, 120], "strain": [0.1, 0.0, 0.02]},
    "output": {"pictures": False},
}
# The tables of all that a file names, by node or element.
TABLES = {
    "result.xdmf": {
        **{f"node {name}": place for name, place in xdmf.CELL_NODES.items()},
        **{f"element {name}": place for name, place in xdmf.CELL_ELEMENTS.items()},
    },
    "interface.xdmf": {f"node {name}": place for name, place in xdmf.INTERFACE_POINTS.items()},
}

pytestmark = pytest.mark.skipif(shutil.which("pvpython") is None, reason="needs ParaView (pvpython)")


def check(directory: Path, *options: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["pvpython", str(SCRIPT), str(directory), *map(str, options)], capture_output=True, text=True, timeout=PATIENCE
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("paraview")
    run(Case.parse(CASE), MPI.COMM_SELF, out=directory)
    return directory


def test_every_reader_sees_all_arrays_in_their_ranges(folder: Path, tmp_path: Path) -> None:
    done = check(folder, "--ranges", tmp_path / "seen.json")
    assert done.returncode == 0, done.stderr
    seen = json.loads((tmp_path / "seen.json").read_text())
    with h5py.File(folder / "result.h5", "r") as file:
        for name, tables in TABLES.items():
            assert len(seen[name]) == 3
            for states in seen[name].values():
                assert [state["label"] for state in states] == ["0 deg", "120 deg"]
                for number, state in enumerate(states):
                    _has_ranges(file, number, state, tables)


def _has_ranges(file: Any, number: int, state: dict[str, Any], tables: dict[str, str]) -> None:
    arrays, attributes = state["arrays"], file[f"state/{number}"].attrs
    assert state["elements"] > 0
    means = {f"state {name}" for name in ("load_factor", "mean_strain", "mean_stress")}
    assert set(arrays) == set(tables) | means
    assert arrays["state load_factor"] == [[attributes["load_factor"]] * 2]
    assert [low for low, _ in arrays["state mean_stress"]] == attributes["stress"].tolist()
    for name, place in tables.items():
        table = file[place.replace("/K/", f"/{number}/")][:]
        columns = table.reshape(len(table), -1)
        expected = np.column_stack([columns.min(axis=0), columns.max(axis=0)])
        np.testing.assert_array_equal(arrays[name], expected, err_msg=name)


def test_what_is_not_shown_is_complained_of(folder: Path, tmp_path: Path) -> None:
    """Points without a connectivity, of which the default reader makes no elements; and a folder without results."""
    broken = shutil.copytree(folder, tmp_path / "broken")
    (broken / "result.xdmf").unlink()
    document = ElementTree.parse(broken / "interface.xdmf")
    for topology in document.iter("Topology"):
        topology.remove(topology[0])
    document.write(broken / "interface.xdmf")
    done = check(broken)
    assert done.returncode == 1 and "interface.xdmf, Xdmf3ReaderS: state 0: no elements" in done.stderr, done.stderr
    done = check(tmp_path)
    assert done.returncode == 1 and "no result.xdmf or interface.xdmf" in done.stderr
