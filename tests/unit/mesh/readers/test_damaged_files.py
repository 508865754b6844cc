"""Files of meshes that are damaged or made to harm: a mesh or faults in one line each come back, nothing else."""

import os
import resource
import signal
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import gmsh  # noqa: F401 - once for all processes that read
import numpy as np
import pytest
from support.abaqus import write_inp
from support.damaged_files import damaged
from support.other_formats import written
from support.vtk_files import write_vtk, write_vtu
from unit.mesh.binary_msh import write_binary
from unit.mesh.faulty_meshes import RIGHT_SIDE, MshFile, grid
from unit.mesh.readers.test_strangers_meshes import by_gmsh
from unit.mesh.second_order import second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import gmsh_file
from feti_homog.mesh.readers.msh_reader import read

MESH = grid().with_curve(RIGHT_SIDE)
SEEDS: dict[str, Callable[[Path], object]] = {
    "text-2.2.msh": MESH.write,
    "second-2.2.msh": second_order(MESH).write,
    "binary-2.2.msh": lambda path: write_binary(MESH, path, "2.2", "<"),
    "binary-4.1.msh": lambda path: write_binary(MESH, path, "4.1", "<"),
    "second-4.1.msh": lambda path: write_binary(second_order(MESH), path, "4.1", ">"),
    "one.inp": lambda path: write_inp(path, MESH),
    "second.inp": lambda path: write_inp(path, second_order(MESH), sets=False),
    "packed.vtu": lambda path: written(MESH, path),
    "text.vtu": lambda path: written(MESH, path, binary=False),
    "binary.vtk": lambda path: written(second_order(MESH), path),
    "text.vtk": lambda path: written(MESH, path, binary=False),
    "old.vtk": lambda path: written(MESH, path, file_format="vtk42"),
    "raw.vtu": lambda path: write_vtu(path, "Appended raw"),
    "bases.vtu": write_vtu,
    "new.vtk": lambda path: write_vtk(path, "Binary", 51, "int32"),
    "medit.mesh": lambda path: by_gmsh(path, grid()),
    "text-4.1.msh": lambda path: path.write_bytes((Path(__file__).parents[4] / "meshes/square.msh").read_bytes()),
}


def outcome(path: Path) -> str:
    """Return how reading a file ends: a mesh or faults."""
    try:
        read(path, phases={"matrix": (1,), "fibre": (2,)} if path.suffix == ".mesh" else {})
    except MeshError as error:
        assert error.faults and all("\n" not in fault and fault.isprintable() for fault in error.faults), error
        return "refused"
    return "read"


@pytest.mark.parametrize("name", SEEDS)
def test_damaged_files_are_read_or_refused(name, tmp_path, count=100, seed=1):
    ends = _ends(name, tmp_path, count, seed)
    assert ends["refused"] > count / 4


HEADER = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
SCRIPT = 'SystemCall "touch executed";\nMerge "other.msh";\n'
SCRIPTS = {
    "script": SCRIPT,
    "before the header": SCRIPT + HEADER,
    "behind the header": HEADER + SCRIPT,
    "in the header": HEADER.replace("2.2 0 8", SCRIPT),
    "a damaged header": HEADER.replace("$MeshFormat\n2", "$MeshFormat 2", 1) + SCRIPT,
    "comments": f"$Comments\nmine\n$EndComments\n{SCRIPT}",
    "open comments": f"$Comments\n{SCRIPT}",
    "names": f"$PhysicalNames\n{SCRIPT}$EndPhysicalNames\n",
    "nodes": f"{HEADER}$Nodes\n{SCRIPT}$EndNodes\n",
    "options": f"{HEADER}$Options\n{SCRIPT}$EndOptions\n",
    "old format": f"$NOD\n{SCRIPT}$ENDNOD\n",
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_text_in_a_mesh_is_not_executed(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("other.msh").write_text(SCRIPT)
    Path("a.msh").write_text(SCRIPTS[name])
    assert outcome(Path("a.msh")) == "refused" and not Path("executed").exists()


@pytest.mark.parametrize("name", SEEDS)
def test_files_beside_a_mesh_are_not_opened(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    SEEDS[name](Path(name))
    for sibling in ("opt", "pos", "geo", "geo.opt", "msh.opt", "msh.pos", "msh.geo", "brep"):
        for stem in (name, Path(name).stem, "gmsh", ".gmshrc", ".gmsh-options", "gmshrc"):
            Path(f"{stem}.{sibling}").write_text(SCRIPT)
    assert outcome(Path(name)) == "read" and not Path("executed").exists()


@pytest.mark.parametrize(
    ("write", "suffix"), [(MshFile.write, "msh"), (lambda mesh, path: write_inp(path, mesh), "inp")]
)
def test_control_characters_of_names_are_escaped(write, suffix, tmp_path):
    mesh = replace(MESH, names={1: "matrix", 2: "red\x1b[31m"}, curves={7: "bell\x07"})
    write(mesh, tmp_path / f"a.{suffix}")
    with pytest.raises(MeshError, match=r'"red\\x1b\[31m" is not a phase'):
        read(tmp_path / f"a.{suffix}")
    write(replace(mesh, names=MESH.names), tmp_path / f"a.{suffix}")
    (remark,) = read(tmp_path / f"a.{suffix}").remarks
    assert '"bell\\x07": not used' in remark and remark.isprintable()


def test_long_words_of_a_file_are_cut(tmp_path):
    faults = replace(MESH, names={1: "matrix", 2: "f:" * 10**5}).faults(tmp_path)
    assert sum(map(len, faults)) < 1100


def test_faults_of_many_kinds_are_counted(tmp_path):
    kinds = range(1, 81)
    elements = {kind: (2, kind, kind, (1, 2, 7)) for kind in kinds}
    faults = MshFile(grid().nodes, elements, {kind: f"kind {kind}" for kind in kinds}).faults(tmp_path)
    assert len(faults) == 21 and faults[-1].endswith("61 more faults")


def test_many_nodes_at_one_place_are_counted(tmp_path):
    """Their pairs would not fit in the memory."""
    count = 20000
    nodes = {k: (float(k % 2), 0.0, 0.0) for k in range(2, count + 2)} | {1: (0.5, 1.0, 0.0)}
    elements = {k: (2, 1, 1, (k, k + 1, 1)) for k in range(2, count + 2, 2)}
    MshFile(nodes, elements).write(tmp_path / "a.msh")
    with pytest.raises(MeshError, match=r"same place \(merge nodes\): node 2 \(0, 0\) and node 4 .* and 19995 more$"):
        read(tmp_path / "a.msh")


def test_many_long_edges_are_not_compared_with_all_nodes(tmp_path):
    """Strips across the cell: each edge is near all nodes."""
    count = 5000
    nodes = {3 * k + j + 1: (j / 2, (k + 0.5 * (j == 1)) / count, 0.0) for k in range(count) for j in range(3)}
    corners = {3 * count + j + 1: (float(j % 2), float(j // 2), 0.0) for j in range(4)}
    elements = {k + 1: (2, 1, 1, (3 * k + 1, 3 * k + 2, 3 * k + 3)) for k in range(count)}
    MshFile(nodes | corners, elements).write(tmp_path / "a.msh")
    with pytest.raises(MeshError, match="14999 edges within the cell have one triangle only, and long ones cross"):
        read(tmp_path / "a.msh")


def test_what_is_no_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "a.msh")
    (tmp_path / "b.msh").symlink_to("/dev/zero")
    (tmp_path / "c.msh").mkdir()
    assert [outcome(tmp_path / f"{name}.msh") for name in "abc"] == ["refused"] * 3


def _ends(name: str, folder: Path, count: int, seed: int) -> Counter[str]:
    path = folder / name
    SEEDS[name](path)
    content, rng = path.read_bytes(), np.random.default_rng(seed)
    assert outcome(path) == "read"
    ends = Counter[str]()
    for _ in range(count):
        path.write_bytes(damaged(content, rng))
        signal.alarm(20 if __name__ == "__main__" else 0)
        ends[outcome(path)] += 1
    return ends


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30,) * 2)
    for name in SEEDS:
        folder = Path(os.environ.get("TMPDIR", "/tmp"))
        print(name, dict(_ends(name, folder, int(sys.argv[1]) // len(SEEDS), int(sys.argv[2]))), flush=True)


def test_elements_without_their_nodes_are_refused():
    """The memory of the process decides whether gmsh reads such a file or crashes."""
    elements = {"Triangle 3": (np.array([7]), np.array([[1, 2, 3]]), np.array([1]))}
    content = gmsh_file.MshContent(np.array([1, 2]), np.eye(3)[:2], elements, {(2, 1): (1,)})
    with pytest.raises(MeshError, match=r"the file is damaged: .* elements without their nodes"):
        gmsh_file.raw_mesh(content)
