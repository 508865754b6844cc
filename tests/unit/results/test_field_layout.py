"""The reference table of result.h5 is what the file holds."""

import h5py
import pytest
from manual_source.record_tables import items, spatial_items
from mpi4py import MPI
from support.sample_output import in_space, sample

from feti_homog.results.field_file import FieldFile
from feti_homog.system.runtime.records import LENGTH, STRESS

UNITS = {LENGTH: "mm", STRESS: "GPa", "": "1", "temperature": "temperature"}  # of the sample


def words_of(described):
    """Return the attributes by which a dataset describes itself."""
    return {"meaning": described.meaning, "unit": UNITS[described.unit]}


PLANE = {(item.path, item.kind): item for item in items()}
SPACE = PLANE | {(item.path, item.kind): item for item in spatial_items()}


@pytest.mark.parametrize("reference", [PLANE, SPACE], ids=["plane", "space"])
def test_all_that_the_file_holds_is_described(tmp_path, reference):
    whole = sample(4) if reference is PLANE else in_space(sample(4))
    with FieldFile(tmp_path, MPI.COMM_SELF, whole.header, whole.mesh, whole.fibres, whole.interface) as file:
        file.write_state(0, whole.states[0])
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
