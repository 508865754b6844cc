"""result.h5 holds what the ranks hand over, in the order of the ranks, however many there are."""

import resource
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support.ranks import parallel_assert
from support.sample_output import Sample, part_of, sample, without_interface

from feti_homog.errors import FetiHomogError
from feti_homog.results.field_file import FieldFile

pytestmark = pytest.mark.parallel


def write(directory: Path, comm: Any, whole: Sample, states: int = 3) -> Path:
    part = part_of(whole, comm.rank, comm.size)
    with FieldFile(directory, comm, part.header, part.mesh, part.fibres, part.interface) as file:
        for k, state in enumerate(part.states[:states]):
            file.write_state(k, state)
    return directory / "result.h5"


@pytest.mark.parametrize(("order", "refine"), [(1, 0), (1, 2), (2, 0)])
def test_the_ranks_parts_make_the_whole_file(comm: Any, shared_path: Path, order: int, refine: int) -> None:
    whole = sample(4, refine, order)
    with h5py.File(write(shared_path, comm, whole), "r") as file:
        # The pieces are numbered in order, so the ranks' shares put together are the whole.
        for name, table in vars(whole.mesh).items():
            np.testing.assert_array_equal(file[f"mesh/{name}"][:], table)
        for name, table in vars(whole.interface).items():
            np.testing.assert_array_equal(file[f"interface/{name}"][:], table)
        assert sorted(file["state"]) == ["0", "1", "2"]
        for k, state in enumerate(whole.states):
            group = file[f"state/{k}"]
            for name in ("displacement", "stress", "traction", "jump", "status"):
                np.testing.assert_array_equal(group[name][:], getattr(state, name))
            np.testing.assert_array_equal(group.attrs["strain"], state.strain)
            np.testing.assert_array_equal(group.attrs["stress"], state.stress_mean)
            assert group.attrs["load_factor"] == 1.0
            assert file[f"vector/state/{k}/displacement"][:, 2].tolist() == [0.0] * len(whole.mesh.points)
            np.testing.assert_array_equal(file[f"vector/state/{k}/displacement"][:, :2], state.displacement)
    comm.barrier()


def test_fields_have_their_attributes_and_types(comm: Any, shared_path: Path) -> None:
    with h5py.File(write(shared_path, comm, sample(4)), "r") as file:
        assert list(file.attrs["phases"]) == ["matrix", "fibre"]
        assert (file.attrs["length_unit"], file.attrs["stress_unit"]) == ("mm", "GPa")
        assert (file.attrs["width"], file.attrs["height"]) == (1.0, 1.0)
        assert (file.attrs["order"], file.attrs["refine"]) == (1, 0)
        assert (file.attrs["title"], file.attrs["created_by"]) == ("sample", "feti_homog")
        assert file["mesh/points"].dtype == np.float64 and file["mesh/points"].chunks is None
        assert file["mesh/triangles"].dtype == np.int64 and file["mesh/body"].dtype == np.int32
        assert file["state/0/status"].dtype == np.int8
    comm.barrier()


def test_tables_without_interface_nodes_are_empty(comm: Any, shared_path: Path) -> None:
    with h5py.File(write(shared_path, comm, without_interface(sample(4))), "r") as file:
        assert file["interface/points"].shape == (0, 2) and file["state/2/status"].shape == (0,)
    comm.barrier()


def test_states_are_on_disk_before_the_file_has_its_name(comm: Any, shared_path: Path) -> None:
    part = part_of(sample(4), comm.rank, comm.size)
    file = FieldFile(shared_path, comm, part.header, part.mesh, part.fibres, part.interface)
    for k, state in enumerate(part.states):
        file.write_state(k, state)
        assert not (shared_path / "result.h5").exists()
        comm.barrier()
        if comm.rank == 0:
            with h5py.File(file.part, "r") as reader:
                assert sorted(reader["state"]) == [str(i) for i in range(k + 1)]
        comm.barrier()
    file.close()
    assert (shared_path / "result.h5").exists() and not file.part.exists()
    comm.barrier()


def test_an_exception_leaves_the_old_file(comm: Any, shared_path: Path) -> None:
    old = write(shared_path, comm, sample(4), states=1)
    part = part_of(sample(4), comm.rank, comm.size)
    arguments = (shared_path, comm, part.header, part.mesh, part.fibres, part.interface)
    with pytest.raises(ZeroDivisionError), FieldFile(*arguments):
        raise ZeroDivisionError
    with h5py.File(old, "r") as file:
        assert list(file["state"]) == ["0"]
    comm.barrier()


def test_a_folder_that_cannot_be_made_is_reported_on_every_rank(comm: Any, shared_path: Path) -> None:
    if comm.rank == 0:
        (shared_path / "file").write_text("")
    with pytest.raises(FetiHomogError, match=r"^cannot write .*result\.h5: .*[Nn]ot a directory$"):
        write(shared_path / "file" / "folder", comm, sample(4))


def test_a_full_disk_is_reported_on_every_rank_and_leaves_no_file(comm: Any, shared_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limits[1]))
    try:
        with pytest.raises(FetiHomogError, match=r"^cannot write .*result\.h5: File too large$"):
            write(shared_path, comm, sample(32))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    comm.barrier()
    assert list(shared_path.iterdir()) == []


def test_a_wrong_number_of_rows_is_heard_everywhere(comm: Any, shared_path: Path) -> None:
    part = part_of(sample(4), comm.rank, comm.size)
    state = part.states[0]
    if comm.rank == comm.size - 1:
        object.__setattr__(state, "stress", np.zeros((3, 3)))
    file = FieldFile(shared_path, comm, part.header, part.mesh, part.fibres, part.interface)
    with pytest.raises((ValueError, RuntimeError), match="/state/0/stress has 3 rows"):
        file.write_state(0, state)
    file.close()


@pytest.mark.parametrize("error", [FetiHomogError("refused"), ValueError("a defect")])
def test_an_error_of_all_ranks_closes_and_removes_the_file(comm: Any, shared_path: Path, error: Exception) -> None:
    part = part_of(sample(2, 0, 1), comm.rank, comm.size)
    file = FieldFile(shared_path, comm, part.header, part.mesh, part.fibres, part.interface)
    with pytest.raises(type(error)), file:
        raise error
    comm.barrier()
    removed = isinstance(error, FetiHomogError)
    parallel_assert(comm, file.part.exists() != removed and bool(file._file) != removed)
    if not removed:
        file._file.close()
