"""Meshes as other programs write them, with names that are no phases: [cell.phases] is all that a case needs."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.pixel_images import quadrilaterals
from support.users_meshes import converted
from support.vtk_files import vtk_grid
from unit.mesh.faulty_meshes import RIGHT_SIDE, MshFile, N, grid, node

from feti_homog import run
from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers.msh_reader import read

meshio = pytest.importorskip("meshio")

NAMES = {1: "Epoxy resin", 2: "E-Glass"}
CODES = {"matrix": 1, "fibre": 2}  # as the files number them
WORDS = {"matrix": "Epoxy resin", "fibre": "e-glass"}


def named() -> MshFile:
    return replace(grid(), names=NAMES)


def by_gmsh(path: Path, mesh: MshFile, **options: float) -> None:
    """Write by gmsh itself, in the format of the suffix."""
    mesh.write(path.with_name("source.msh"))
    converted(path.with_name("source.msh"), path, **options)


def by_meshio(path: Path, data: str | None, kind: str | None = None, sets: bool = False) -> None:
    """Write by meshio: cell data of this name, or sets of cells."""
    elements = list(grid().elements.values())
    numbers = np.array([e[1] for e in elements])
    points = np.array(list(grid().nodes.values()))
    cells = [("triangle", np.array([e[3] for e in elements]) - 1)]
    more: dict[str, Any] = {"cell_data": {data: [numbers]}} if data else {}
    if sets:
        more |= {"cell_sets": {name: [np.flatnonzero(numbers == k)] for k, name in ((1, "Resin"), (2, "Glass"))}}
    meshio.Mesh(points, cells, **more).write(path, **({"file_format": kind} if kind else {}))


def by_vtk(path: Path) -> None:
    """Write by VTK: compressed, appended, with normals that nobody needs."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(vtk_grid(name="RegionId", first=1))
    writer.Write()


def abaqus_cae(path: Path) -> None:
    """Abaqus/CAE's words: picked sets, sections with materials, an assembly, steps."""
    elements = grid().elements
    lines = ["*Heading", "** Job name: Job-1 Model name: Model-1", "*Preprint, echo=NO, model=NO", "*Part, name=Part-1"]
    lines += ["*Node"] + [f"{tag:7d}, {x:12.9g}, {y:12.9g}" for tag, (x, y, _) in grid().nodes.items()]
    lines += ["*Element, type=CPE3"] + [f"{tag}, {', '.join(map(str, e[3]))}" for tag, e in elements.items()]
    for number, name in ((1, "Set-1"), (2, "_PickedSet5")):
        tags = [str(tag) for tag, e in elements.items() if e[1] == number]
        lines += [f"*Elset, elset={name}, internal", *(", ".join(tags[k : k + 16]) for k in range(0, len(tags), 16))]
    lines += ["*Elset, elset=ALL, generate", "1, 32, 1"]
    for name, material in (("Set-1", '"Epoxy resin"'), ("_PickedSet5", "E-Glass")):
        lines += ["** Section: S", f"*Solid Section, elset={name}, material={material}", ","]
    lines += ["*End Part", "*Assembly, name=Assembly", "*Instance, name=Part-1-1, part=Part-1", "*End Instance"]
    lines += [
        "*End Assembly",
        '*Material, name="Epoxy resin"',
        "*Elastic",
        "3.4, 0.35",
        "*Step, name=Step-1",
        "*End Step",
    ]
    path.write_text("\n".join([*lines, ""]))


def calculix(path: Path, kind: str = "CPE4") -> None:
    """Quadrilaterals in sets that overlap, as CalculiX's preprocessors write them."""
    lines = ["*NODE, NSET=Nall", *(f"{tag},{x:e},{y:e},{z:e}" for tag, (x, y, z) in grid().nodes.items())]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=Eall")
    members: dict[int, list[str]] = {1: [], 2: []}
    for j in range(N):
        for i in range(N):
            tag = 1 + i + N * j
            corners = (node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1))
            lines.append(", ".join(map(str, (tag, *corners))))
            members[grid().elements[2 * tag][1]].append(str(tag))
    for number, name in ((1, "E_RESIN"), (2, "E_GLASS")):
        lines += [f"*ELSET, ELSET={name}", *members[number]]
    path.write_text("\n".join([*lines, "*ELSET, ELSET=Ewhole", "Eall", ""]))


def quads() -> MshFile:
    """Return the grid of quadrilaterals."""
    return quadrilaterals(np.pad(np.ones((2, 2), int), 1))


def in_few_letters(path: Path) -> None:
    """Write Abaqus/CAE's words with the keyword of the elements abbreviated."""
    abaqus_cae(path)
    text = path.read_text()
    assert "*Element, type" in text
    path.write_text(text.replace("*Element, type", "*ELEM, TYP"))


def by_way_of_med(path: Path) -> None:
    """Convert by gmsh, which fills the names in MED files with blanks."""
    by_gmsh(path.with_name("b.med"), named())
    converted(path.with_name("b.med"), path)
    assert b'"E-Glass  ' in path.read_bytes()


def as_floats(path: Path) -> None:
    """Write material numbers as 1.0 and 2.0, beside stresses."""
    by_meshio(path.with_name("b.vtu"), "material_id")
    mesh = meshio.read(path.with_name("b.vtu"))
    (numbers,) = mesh.cell_data["material_id"]
    mesh.cell_data = {"material_id": [numbers.astype(float)], "stress": [0.3 * numbers]}
    mesh.write(path)


SETS = {"matrix": "Resin", "fibre": ["Glass"]}
FILES = {
    "gmsh, names": ("a.msh", lambda path: by_gmsh(path, named()), WORDS),
    "gmsh, numbers": ("a.msh", lambda path: by_gmsh(path, replace(grid(), names={}), MshFileVersion=2.2), CODES),
    "gmsh, numbers of names, binary": ("a.msh", lambda path: by_gmsh(path, named(), Binary=1), CODES),
    "gmsh's Abaqus": (
        "a.inp", lambda path: by_gmsh(path, named(), SaveGroupsOfElements=1),
        {"matrix": "EPOXY_resin", "fibre": "E-Glass"},
    ),
    "gmsh's Medit": ("a.mesh", lambda path: by_gmsh(path, named()), CODES),
    "gmsh's VTK": ("a.vtk", lambda path: by_gmsh(path, named()), CODES),
    "meshio's gmsh": ("a.msh", lambda path: by_meshio(path, "gmsh:physical", "gmsh22"), CODES),
    "meshio's Abaqus": ("a.inp", lambda path: by_meshio(path, None, "abaqus", sets=True), SETS),
    "gmsh's MED": ("a.msh", by_way_of_med, WORDS),
    "meshio's VTU": ("a.vtu", lambda path: by_meshio(path, "mat_id"), {"matrix": [1], "fibre": 2}),
    "meshio's Medit": ("a.mesh", lambda path: by_meshio(path, "medit:ref", "medit"), CODES),
    "whole numbers as floats": ("a.vtu", as_floats, CODES),
    "VTK": ("a.vtu", by_vtk, CODES),
    "Abaqus/CAE": ("a.inp", abaqus_cae, WORDS),
    "Abaqus/CAE, few letters": ("a.inp", in_few_letters, WORDS),
    "gmsh, quadrilaterals": ("a.msh", lambda path: quads().write(path), CODES),
    "gmsh's Medit, quadrilaterals": ("a.mesh", lambda path: by_gmsh(path, quads()), CODES),
    "gmsh's VTK, quadrilaterals": ("a.vtk", lambda path: by_gmsh(path, quads()), CODES),
    "CalculiX": ("a.inp", calculix, {"matrix": "e_resin", "fibre": "e_glass"}),
    "CalculiX, shells": ("a.inp", lambda path: calculix(path, "S4R"), {"matrix": "e_resin", "fibre": "e_glass"}),
}  # fmt: skip


def stiffness(path: Path, **cell: Any) -> Any:
    return run(case_of({"geometry": "mesh", "file": str(path)} | cell), MPI.COMM_SELF).effective_stiffness


def cut_by_turns() -> MshFile:
    """Return the grid with every second square cut the other way."""
    mesh = grid()
    for k in (k for k in range(N * N) if (k % N + k // N) % 2):
        _, phase, _, (a, b, c) = mesh.elements[2 * k + 1]
        d = mesh.elements[2 * k + 2][3][2]
        mesh = mesh.with_element(2 * k + 1, 2, phase, (a, b, d)).with_element(2 * k + 2, 2, phase, (b, c, d))
    return mesh


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Provide the stiffnesses of the same triangles with the names of phases, by whether they were squares."""
    path = tmp_path_factory.mktemp("own") / "own.msh"
    found = {}
    for squares, mesh in ((False, grid()), (True, cut_by_turns())):
        mesh.write(path)
        found[squares] = stiffness(path)
    return found


@pytest.mark.parametrize("name", FILES)
def test_a_strangers_mesh_is_run_as_it_is(tmp_path, expected, name):
    file, write, phases = FILES[name]
    write(tmp_path / file)
    right = expected[any(word in name for word in ("CalculiX", "quadrilaterals"))]
    np.testing.assert_allclose(stiffness(tmp_path / file, phases=phases), right, rtol=1e-6, atol=1e-6)


def test_refused_names_are_listed_with_the_way_out(tmp_path):
    faults = named().faults(tmp_path)
    assert faults[-1].endswith(
        'no physical surface is named "matrix"; the file has "Epoxy resin", "E-Glass", 1, 2. If "Epoxy resin" is the '
        'matrix, add to [cell]: phases = {matrix = "Epoxy resin", fibre = "E-Glass"}. Shares of the area: '
        '"Epoxy resin": 75 %, "E-Glass": 25 %'
    )
    (fault,) = named().faults(tmp_path, phases={"matrix": (1,), "fibre": ("Glas",)})
    assert '[cell.phases] fibre = "Glas": no elements of that name; the file has "Epox' in fault


@pytest.mark.parametrize("names", [{1: "epoxy", 2: "glass"}, {2: "glass", 1: "epoxy"}], ids=["epoxy", "glass"])
def test_the_matrix_proposed_is_the_largest_group(tmp_path, names):
    faults = replace(grid(lambda x, y: y > 0.25), names=names).faults(tmp_path)
    assert 'phases = {matrix = "glass", fibre = "epoxy"}' in faults[-1]
    assert '"epoxy": 25 %' in faults[-1] and '"glass": 75 %' in faults[-1]


def test_sets_that_meshio_copies_from_gmsh_are_read(tmp_path):
    """They have numbers such as 12.0, and entities of gmsh, which may be negative."""
    by_meshio(tmp_path / "a.inp", None, "abaqus", sets=True)
    expected, text = read(tmp_path / "a.inp", phases={"matrix": ("resin",), "fibre": ("glass",)}), ""
    for line in (tmp_path / "a.inp").read_text().splitlines(keepends=True):
        is_set = text.rfind("*ELSET") > text.rfind("*ELEMENT") and not line.startswith("*")
        text += re.sub(r"(\d+)", r"\1.0", line) if is_set else line
    (tmp_path / "b.inp").write_text(f"{text}*ELSET, ELSET=gmsh:bounding_entities\n2,3,-7,-6\n")
    found = read(tmp_path / "b.inp", phases={"matrix": ("resin",), "fibre": ("glass",)})
    assert "1.0,2.0," in text and (found.phase == expected.phase).all()


def test_shares_of_a_group_are_those_of_all_its_surfaces(tmp_path):
    """Each element is a surface of its own."""
    elements = {tag: (kind, own, tag, nodes) for tag, (kind, own, _, nodes) in grid().elements.items()}
    fault = replace(grid(), elements=elements, names={2: "Glass", 1: "Epoxy"}).faults(tmp_path)[-1]
    assert 'If "Epoxy" is the matrix' in fault and '"Epoxy": 75 %' in fault and '"Glass": 25 %' in fault


def test_an_ansys_file_by_meshio_is_refused_with_the_way_out(tmp_path):
    by_meshio(tmp_path / "a.msh", None)
    with pytest.raises(MeshError, match=r'like a file of Ansys: with meshio, write with file_format = "gmsh22"'):
        read(tmp_path / "a.msh")


def test_a_meshed_void_is_no_phase_to_be_named(tmp_path):
    faults = replace(grid(), names={1: "void", 2: "resin"}).faults(tmp_path)
    assert "expected no elements in a void" in faults[0]
    assert 'phases = {matrix = "resin"}' in faults[-1]


def test_debonded_lines_have_any_name(tmp_path):
    mesh = grid().with_curve(RIGHT_SIDE, "Crack")
    mesh.write(tmp_path / "a.msh")
    assert len(read(tmp_path / "a.msh", phases={"debonded": ("crack",)}).debonded_edges) == len(RIGHT_SIDE)
    with pytest.raises(MeshError, match=r'debonded = "crak": no lines of that name; the file has "Crack"'):
        read(tmp_path / "a.msh", phases={"debonded": ("crak",)})


def test_concave_quadrilaterals_are_cut_where_both_halves_have_area(tmp_path):
    calculix(tmp_path / "a.inp")
    places = ("5.000000e-01,5.000000e-01", "3.000000e-01,7.000000e-01")
    old, new = (f"\n{node(2, 2)},{place}" for place in places)
    text = (tmp_path / "a.inp").read_text()
    assert old in text
    (tmp_path / "a.inp").write_text(text.replace(old, new))
    mesh = read(tmp_path / "a.inp", phases={"matrix": ("e_resin",), "fibre": ("e_glass",)})
    assert len(mesh.triangles) == 32 and areas(mesh.points, mesh.triangles).sum() == pytest.approx(1.0)
