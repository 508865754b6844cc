"""The reference table of result.h5 is what the file holds."""

from __future__ import annotations

import h5py
from mpi4py import MPI
from support.sample_output import sample

from feti_homog.common.records import LENGTH, STRESS
from feti_homog.output.files.field_file import FieldFile
from feti_homog.output.files.field_layout import items

UNITS = {LENGTH: "mm", STRESS: "GPa", "": "1"}  # of the sample


def words_of(described):
    """The attributes by which a dataset describes itself."""
    return {"meaning": described.meaning, "unit": UNITS[described.unit]}


def test_all_that_the_file_holds_is_described(tmp_path):
    whole = sample(4)
    with FieldFile(tmp_path, MPI.COMM_SELF, whole.header, whole.mesh, whole.fibres, whole.interface) as file:
        file.write_state(0, whole.states[0])
    found = set()
    with h5py.File(tmp_path / "result.h5", "r") as reader:
        found |= {("/", f"attribute {name}") for name in reader.attrs}

        def visit(name, item):
            path = f"/{name}".replace("/state/0", "/state/K")
            if isinstance(item, h5py.Dataset):
                found.add((path, "dataset"))
                described = next(i for i in items() if i.path == path and i.kind == "dataset")
                assert dict(item.attrs) == words_of(described), path
                assert item.dtype == described.dtype and item.ndim == described.shape.count(",") + (
                    0 if described.shape.endswith(",)") else 1
                ), path
            else:
                found.update((path, f"attribute {key}") for key in item.attrs)

        reader.visititems(visit)
    assert found == {(item.path, item.kind) for item in items()}
    assert all(item.meaning for item in items())
