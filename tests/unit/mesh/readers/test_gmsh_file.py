"""The reader of .msh files: every form that gmsh writes, names, faults."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.users_meshes import converted, polar_cell
from unit.mesh.binary_msh import write_binary
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid
from unit.mesh.second_order import second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import gmsh_file
from feti_homog.mesh.readers.msh_reader import made, read
from feti_homog.mesh.readers.raw_mesh import Block, RawMesh, assembled
from feti_homog.mesh.tiles.tile_filling import gmsh_session

MESHES = Path(__file__).parents[4] / "meshes"
TOLERANCE = 1e-12
NODES = {2: 3, 9: 6, 3: 4, 10: 9, 16: 8}  # of gmsh's triangles and quadrilaterals
FORMATS = [(2.2, 0), (2.2, 1), (4.0, 0), (4.1, 0), (4.1, 1)]


def by_gmsh(path: Path) -> RawMesh:
    """Return what gmsh reads from a file."""
    with gmsh_session() as session:
        session.open(str(path))
        mesh, name = session.model.mesh, lambda tag, dimension: session.model.getPhysicalName(dimension, tag)
        blocks, groups = [], []
        for _, entity in session.model.getEntities(2):
            for kind, count in NODES.items():
                tags, nodes = mesh.getElementsByType(kind, entity)
                if len(tags):
                    nodes = nodes.reshape(-1, count).astype(np.int64)
                    blocks.append(Block(tags.astype(np.int64), nodes, np.full(len(tags), len(groups))))
                    physical = session.model.getPhysicalGroupsForEntity(2, entity)
                    groups.append(tuple(name(tag, 2) or f"number {tag}" for tag in physical))
        curves = {}
        for _, group in session.model.getPhysicalGroups(1):
            entities = session.model.getEntitiesForPhysicalGroup(1, group)
            ends = [
                mesh.getElementsByType(kind, entity)[1].astype(np.int64).reshape(-1, count)[:, :2]
                for entity in entities
                for kind, count in ((1, 2), (8, 3))
            ]
            curves.setdefault(name(group, 1) or f"number {group}", []).extend(ends)
        tags, places, _ = mesh.getNodes()
        curves = {name: np.concatenate(ends) for name, ends in curves.items()}
        return assembled(tags.astype(np.int64), places.reshape(-1, 3), blocks, groups, curves)


def assert_same(result: RawMesh, expected: RawMesh, ordered: bool = True) -> None:
    """Compare all that was read; elements by their numbers unless they are `ordered` alike.

    gmsh moves periodic nodes of some files to their partners.
    """
    assert np.array_equal(result.node_tags, expected.node_tags)
    assert result.points == pytest.approx(expected.points, rel=0, abs=TOLERANCE)
    orders = [slice(None) if ordered else np.argsort(mesh.element_tags) for mesh in (result, expected)]
    for name in ("element_tags", "triangles"):
        one, other = (getattr(mesh, name)[order] for mesh, order in zip((result, expected), orders, strict=True))
        assert np.array_equal(one, other), name
    one, other = (_labels(mesh)[order] for mesh, order in zip((result, expected), orders, strict=True))
    assert np.array_equal(one, other)
    assert list(result.curves) == list(expected.curves)
    assert all(np.array_equal(_sorted(result.curves[name]), _sorted(expected.curves[name])) for name in result.curves)
    for name in ("edges", "tags", "points"):
        one, other = (np.sort(getattr(mesh.middles, name), axis=0) for mesh in (result, expected))
        assert one == pytest.approx(other, rel=0, abs=TOLERANCE), name
    assert (result.container, result.curve_container) == (expected.container, expected.curve_container)


def _labels(mesh: RawMesh) -> np.ndarray:
    """Return the physical groups of each element."""
    return np.array([" and ".join(sorted(names)) for names in mesh.groups])[mesh.group]


def _sorted(pairs: np.ndarray) -> np.ndarray:
    return pairs[np.lexsort(pairs.T)]


@pytest.mark.parametrize("name", ["square", "hexagonal", "two_fibres"])
def test_cells_of_the_repository_are_those_of_gmsh_to_the_last_bit(name):
    result, expected = read(MESHES / f"{name}.msh"), made(by_gmsh(MESHES / f"{name}.msh"), "oracle")
    for key in ("width", "height", "points", "triangles", "phase", "representative", "arc_circle", "arc_edges"):
        assert np.array_equal(getattr(result, key), getattr(expected, key)), key
    assert np.array_equal(result.ellipses.circles, expected.ellipses.circles, equal_nan=True)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    "options",
    [{}, {"SaveAll": 1}, {"SaveParametric": 1}, {"SaveParametric": 1, "SaveAll": 1}, {"parts": 3}],
    ids=lambda options: "-".join(options) or "plain",
)
@pytest.mark.parametrize(("version", "binary"), FORMATS)
def test_files_of_every_kind_are_read_as_by_gmsh(version, binary, options, order, tmp_path):
    polar_cell((0.9, 0.1), 0.3, tmp_path / "cell.msh", order=order, size=0.25)
    path = converted(tmp_path / "cell.msh", tmp_path / "a.msh", MshFileVersion=version, Binary=binary, **options)
    result = gmsh_file.load(path)
    assert len(result.triangles) > 30
    assert_same(result, by_gmsh(path), ordered="parts" not in options)


@pytest.mark.parametrize("mesh", [grid(), second_order(grid().with_curve(RIGHT_SIDE))], ids=["first", "second"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_both_byte_orders_are_read_as_by_gmsh(version, order, mesh, tmp_path):
    path = write_binary(mesh, tmp_path / "a.msh", version, order)
    mesh.write(tmp_path / "text.msh")
    assert_same(gmsh_file.load(path), by_gmsh(path))
    assert_same(gmsh_file.load(path), gmsh_file.load(tmp_path / "text.msh"))


HEAD_2, HEAD_4 = (f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n" for version in ("2.2", "4.1"))
NODES_2 = "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
ELEMENTS_2 = "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n"
NODES_4 = "$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"
ELEMENTS_4 = "$Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n"
FILE_2, FILE_4 = HEAD_2 + NODES_2 + ELEMENTS_2, HEAD_4 + NODES_4 + ELEMENTS_4


@pytest.mark.parametrize("version", ["2", "2.0", "2.000000", "2.2"])
def test_netgens_numbers_of_the_version_are_read(version, tmp_path):
    (tmp_path / "A.MSH").write_text(FILE_2.replace("2.2", version, 1))
    assert gmsh_file.load(tmp_path / "A.MSH").groups == (("number 1",),)


FAULTS = {
    "format 3": (FILE_2.replace("2.2", "3"), 'format "3" of gmsh: expected 2.2, 4.0 or 4.1'),
    "no version": ("$MeshFormat\n$EndMeshFormat\n", 'format "" of gmsh: expected 2.2, 4.0 or 4.1'),
    "format 1": ("$NOD\n0\n$ENDNOD\n", "format 1 of gmsh: save it in format 2.2 or 4.1"),
    "short numbers": (
        FILE_2.replace("0 8", "0 4", 1),
        "$MeshFormat: expected 0 8 behind the version of text and 1 8 of binary",
    ),
    "byte order": (FILE_2.replace("0 8", "1 8", 1), "1 elements are announced, and 0 are there"),
    "no format": (f"$Comments\n$EndComments\n{NODES_2}", "there is no $MeshFormat"),
    "nodes twice": (HEAD_2 + NODES_2 + NODES_2, "$Nodes: it is there twice"),
    "names": (f'{HEAD_2}$PhysicalNames\n2\n2 1 "a"\n$EndPhysicalNames\n', "$PhysicalNames: 1 names, and not as many"),
    "two names": (
        f'{HEAD_2}$PhysicalNames\n2\n2 1 "a"\n2 1 "b"\n$EndPhysicalNames\n',
        "$PhysicalNames: one of the numbers has two names",
    ),
    "open names": (
        f"{HEAD_2}$PhysicalNames\n0\n",
        "$PhysicalNames: there is no $EndPhysicalNames: the file is damaged",
    ),
    "open comments": (f"{HEAD_2}$Comments\n", "$Comments: there is no $EndComments"),
    "a word": (FILE_2.replace("2 1 0 0", "2 one 0 0"), "gmsh cannot read it: the file is damaged"),
    "an underscore": (FILE_2.replace("2 1 0 0", "2 1_0 0 0"), "gmsh cannot read it: the file is damaged"),
    "a fraction": (FILE_2.replace("1 2 2 1", "1 2.5 2 1"), "gmsh cannot read it: the file is damaged"),
    "half a node": (
        FILE_2.replace("2 1 0 0", "2.5 1 0 0"),
        "the file is damaged: gmsh crashes on it",
    ),
    "twenty digits": (FILE_2.replace("2 1 0 0", f"{'9' * 20} 1 0 0"), "gmsh cannot read it: Wrong node index 2"),
    "twenty digits of an element": (
        FILE_2.replace("1 2 3\n$", f"1 2 {'9' * 20}\n$"),
        "gmsh cannot read it: Wrong node index",
    ),
    "nan as a count": (FILE_2.replace("Nodes\n3", "Nodes\nnan"), "gmsh cannot read it: the file is damaged"),
    "huge count": (
        FILE_2.replace("Nodes\n3", "Nodes\n1000000000000"),
        "gmsh cannot read it: Wrong node index",
    ),
    "negative count": (FILE_2.replace("Nodes\n3", "Nodes\n-1"), "gmsh cannot read it: Wrong node index"),
    "numbers left": (FILE_2.replace("Nodes\n3", "Nodes\n2"), "the file is damaged: gmsh crashes on it"),
    "elements left": (
        FILE_2.replace("nts\n1\n", "nts\n0\n"),
        "$Elements: 2 lines, and its counts announce 1, one for each element",
    ),
    "elements too many": (
        FILE_2.replace("nts\n1\n", "nts\n1\n2 2 2 1 1 1 2 3\n"),
        "$Elements: 3 lines, and its counts announce 2, one for each element",
    ),
    "elements missing": (
        FILE_2.replace("nts\n1\n", "nts\n2\n"),
        "$Elements: 2 lines, and its counts announce 3, one for each element",
    ),
    "element cut": (
        FILE_2.replace("1 2 3\n$", "1 2\n$"),
        "gmsh cannot read it: the file is damaged",
    ),
    "negative tags": (FILE_2.replace("1 2 2 1", "1 2 -2 1"), "not in any physical surface"),
    "strange type": (
        FILE_2.replace("1 2 2 1", "1 36 2 1"),
        "gmsh cannot read it: the file is damaged",
    ),
    "node twice": (FILE_2.replace("2 1 0 0", "1 1 0 0"), "gmsh cannot read it: Skipping duplicate node 1"),
    "strange type in 4": (
        FILE_4.replace("2 1 2 1\n1 1", "2 1 36 1\n1 1"),
        "gmsh cannot read it: Could not read elements",
    ),
    "wrong dimension": (
        FILE_4.replace("2 1 2 1\n1 1", "1 1 2 1\n1 1"),
        "gmsh cannot read it: Unknown entity 1 of dimension 1",
    ),
    "dimension 4": (FILE_4.replace("2 1 0 3", "4 1 0 3"), "gmsh cannot read it: Invalid dimension 4"),
    "elements missing in 4": (FILE_4.replace("nts\n1 1", "nts\n1 2"), "$Elements: 3 lines, and its counts announce 4"),
    "huge block": (
        FILE_4.replace("2 1 0 3", "2 1 0 1000000000000"),
        "gmsh cannot read it: the file is damaged",
    ),
    "huge number of blocks": (
        FILE_4.replace("nts\n1 1", "nts\n1000000000000 1"),
        "$Elements: 3 lines, and its counts announce 1000000000002",
    ),
    "huge number of entities": (
        f"{HEAD_4}$Entities\n1000000000000 0 0 0\n$EndEntities\n",
        "gmsh cannot read it: Could not read entities",
    ),
    "a section of another name": (
        FILE_2.replace("$Elements", "$elements").replace("$EndElements", "$Endelements"),
        'line 10: "$elements": expected a section of a mesh, such as $Nodes, or $Comments',
    ),
    "words between sections": (FILE_2.replace("$Elements", "more\n$Elements"), 'line 10: "more": expected a section'),
    "elements behind the end": (FILE_2 + "2 2 2 1 1 1 2 3\n", 'line 14: "2 2 2 1 1 1 2 3": expected a section'),
    "no group": (FILE_4, "element 1 at (0.333333333, 0.333333333): not in any physical surface"),
    "no name": (FILE_2, 'no physical surface is named "matrix"; the file has 1. If 1 is the matrix, add'),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_the_format_are_named(name, tmp_path):
    content, message = FAULTS[name]
    (tmp_path / "a.msh").write_text(content)
    with pytest.raises(MeshError) as caught:
        read(tmp_path / "a.msh")
    assert caught.value.faults[0].startswith("a.msh: ") and message in caught.value.faults[0]


def test_every_kind_of_unusable_elements_is_named(tmp_path):
    mesh = grid()
    nodes = list(mesh.nodes)[:5]
    solids = {901: (4, 1, 1, tuple(nodes[:4])), 902: (7, 1, 1, tuple(nodes))}
    replace(mesh, elements=mesh.elements | solids).write(tmp_path / "a.msh")
    with pytest.raises(MeshError) as caught:
        gmsh_file.load(tmp_path / "a.msh")
    tetrahedra, pyramids = caught.value.faults
    assert tetrahedra.startswith("element 901 at ") and "Tetrahedron" in tetrahedra
    assert pyramids.startswith("element 902 at ") and "Pyramid" in pyramids


def test_sections_without_nodes_and_elements_are_passed_over(tmp_path):
    """Comments, periodic nodes and data, blank lines and line ends of another system."""
    grid().write(tmp_path / "one.msh")
    text = (tmp_path / "one.msh").read_text()
    other = "$Comments\nmine\n$Nodes\n$EndComments\n\n" + text.replace("$Nodes", "\n  \n$Nodes", 1)
    periodic = "$Periodic\n1\n0 1 2\n1\n3 4\n$EndPeriodic\n$NodeData\nx\n$EndNodeData\n"
    (tmp_path / "other.msh").write_bytes((other + periodic).replace("\n", "\r\n").encode())
    assert_same(gmsh_file.load(tmp_path / "other.msh"), gmsh_file.load(tmp_path / "one.msh"))


def test_any_number_of_tags_is_read_as_by_gmsh(tmp_path):
    """Partitions of version 2."""
    lines = ["1 15 2 0 1 1", "2 2 5 1 1 2 1 3 1 2 3", "3 1 4 1 1 1 2 1 2"]
    (tmp_path / "a.msh").write_text(FILE_2.replace("1\n1 2 2 1 1 1 2 3", "3\n" + "\n".join(lines)))
    assert_same(gmsh_file.load(tmp_path / "a.msh"), by_gmsh(tmp_path / "a.msh"), ordered=False)


def test_groups_that_turn_an_entity_have_their_name(tmp_path):
    """Their numbers are negative in the entity: `Physical Surface("fibre") = {-2}`."""
    text, (old, new) = (MESHES / "square.msh").read_text(), ("0 1 2 4 5 6 7 8", "0 1 -2 4 5 6 7 8")
    assert old in text
    (tmp_path / "a.msh").write_text(text.replace(old, new))
    assert_same(gmsh_file.load(tmp_path / "a.msh"), gmsh_file.load(MESHES / "square.msh"))


@pytest.mark.parametrize("last", [1, 2])
def test_an_entity_in_two_physical_groups_is_read_as_by_gmsh(last, tmp_path):
    grid().with_element(1, 2, 2, grid().elements[1][3]).write(tmp_path / "a.msh")
    text = (tmp_path / "a.msh").read_text().replace("1 2 2 2 2 ", "1 2 2 2 1 ")
    (tmp_path / "a.msh").write_text(text)
    path = converted(tmp_path / "a.msh", tmp_path / "b.msh", MshFileVersion=4.1) if last == 2 else tmp_path / "a.msh"
    assert_same(gmsh_file.load(path), by_gmsh(path))
    with pytest.raises(MeshError, match="in 2 physical surfaces: "):
        read(path)
