"""The XDMF files name data that exist, and the reference table of result.h5 is what the file holds."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import h5py
import pytest
from manual_source.record_tables import items, spatial_items
from support.sample_output import in_space, sample, without_interface, write

from feti_homog.results import xdmf
from feti_homog.system.runtime.records import LENGTH, STRESS


@pytest.mark.parametrize(("name", "tables"), [("cell", 2 + 1 + 10), ("interface", 2 + 16)])
def test_xdmf_points_at_tables_of_the_right_shape(tmp_path: Path, name: str, tables: int) -> None:
    write(tmp_path, sample(4, order=2))
    paths = dict(zip(("cell", "interface"), xdmf.write(tmp_path), strict=True))
    root = ET.parse(paths[name]).getroot()
    found = [item for item in root.iter("DataItem") if item.get("Format") == "HDF"]
    assert len(found) == 3 * tables
    with h5py.File(tmp_path / "result.h5", "r") as file:
        for item in found:
            place, _, path = str(item.text).partition(":")
            assert place == "result.h5"
            assert " ".join(map(str, file[path].shape)) == item.get("Dimensions")
    (collection,) = root.findall("./Domain/Grid")
    assert (collection.get("Name"), collection.get("CollectionType")) == (name, "Temporal")
    assert [time.get("Value") for time in root.iter("Time")] == ["0", "1", "2"]
    labels = [grid.get("Name") for grid in root.iter("Grid") if grid.get("GridType") == "Uniform"]
    assert labels == ["state 0", "state 1", "state 2"]
    kind = {"cell": "Triangle_6", "interface": "Polyvertex"}[name]
    assert {topology.get("TopologyType") for topology in root.iter("Topology")} == {kind}


def test_all_readers_know_the_forms(tmp_path: Path) -> None:
    """ParaView's default reader takes no hyperslabs and no topology without connectivity, and turns tensors of six."""
    write(tmp_path, sample(4))
    for path in xdmf.write(tmp_path):
        root = ET.parse(path).getroot()
        assert not [item for item in root.iter("DataItem") if item.get("ItemType")]
        assert all(len(topology) == 1 for topology in root.iter("Topology"))
        kinds = {attribute.get("AttributeType") for attribute in root.iter("Attribute")}
        assert kinds <= {"Scalar", "Vector", "Tensor"}


def test_xdmf_without_interface_nodes_is_one_file(tmp_path: Path) -> None:
    write(tmp_path, without_interface(sample(4)))
    assert xdmf.write(tmp_path) == [tmp_path / "result.xdmf"]
    assert [path.name for path in tmp_path.glob("*.xdmf")] == ["result.xdmf"]


UNITS = {LENGTH: "mm", STRESS: "GPa", "": "1", "temperature": "temperature"}  # of the sample


def words_of(described):
    """Return the attributes by which a dataset describes itself."""
    return {"meaning": described.meaning, "unit": UNITS[described.unit]}


PLANE = {(item.path, item.kind): item for item in items()}
SPACE = PLANE | {(item.path, item.kind): item for item in spatial_items()}


@pytest.mark.parametrize("reference", [PLANE, SPACE], ids=["plane", "space"])
def test_all_that_the_file_holds_is_described(tmp_path, reference):
    whole = sample(4) if reference is PLANE else in_space(sample(4))
    write(tmp_path, replace(whole, states=whole.states[:1]))
    found = set()
    with h5py.File(tmp_path / "result.h5", "r") as reader:
        found |= {("/", f"attribute {name}") for name in reader.attrs}

        def visit(name, item):
            path = f"/{name}".replace("/state/0", "/state/K")
            if isinstance(item, h5py.Dataset):
                found.add((path, "dataset"))
                described = reference[path, "dataset"]
                assert dict(item.attrs) == words_of(described), path
                assert item.dtype == described.dtype and item.ndim == described.shape.count(",") + (
                    0 if described.shape.endswith(",)") else 1
                ), path
            else:
                found.update((path, f"attribute {key}") for key in item.attrs)

        reader.visititems(visit)
    assert found == set(reference)
    assert all(item.meaning for item in reference.values())
