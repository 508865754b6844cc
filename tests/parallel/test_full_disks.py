"""A disk that is full at any moment: one line, the exit code of a file that cannot be written, no rank left waiting."""

import errno
import json
import os
import resource
import subprocess
from contextlib import contextmanager

import pytest
from support import events
from support.base_case import BASE
from support.ranks import parallel_assert, told_once
from support.sample_output import part_of, sample
from support.small_path import PATH

from feti_homog import cli
from feti_homog.errors import FetiHomogError
from feti_homog.results import atomic
from feti_homog.results.field_file import RESERVE, FieldFile

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


CASE = BASE.replace("mesh_size = 0.05", "mesh_size = 0.3") + "[output]\npictures = false\n"


@pytest.fixture
def small_disk(comm, shared_path):
    """Mounts a disk of that size and returns its path; it is taken away after the test."""
    mounted = []

    def mount(size):
        path = shared_path / "disk"
        if comm.rank == 0:
            path.mkdir()
            words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path)]
            mounted.append(subprocess.run(words, capture_output=True).returncode == 0)
        if not comm.bcast(mounted and mounted[-1]):
            pytest.skip("only root can mount a small disk")
        return path

    yield mount
    comm.barrier()
    if comm.rank == 0 and any(mounted):
        subprocess.run(["umount", "--lazy", str(shared_path / "disk")], check=True)
    comm.barrier()


@contextmanager
def file_limit(size):
    """No file may grow beyond so many bytes, whoever writes it."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@contextmanager
def no_space_for(*names):
    """No space is left when a file whose path ends with these names gets its name."""
    commit = atomic.commit

    def full(part, path):
        if path.parts[-len(names) :] == names:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        commit(part, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(atomic, "commit", full)
        yield


def run(comm, folder, out, case=CASE, *words):
    if comm.rank == 0:
        (folder / "cell.toml").write_text(case)
    comm.barrier()
    return cli.main(["run", str(folder / "cell.toml"), "--out", str(out), "--quiet", *words])


@pytest.mark.parametrize("size", ["4k", "16k", "64k", "200k"])
def test_a_disk_that_is_full_before_the_first_byte(comm, shared_path, small_disk, capsys, size):
    """HDF5 crashes or waits for ever if its own first bytes do not fit."""
    disk = small_disk(size)
    parallel_assert(comm, run(comm, shared_path, disk / "out") == 1)
    told_once(comm, capsys, "error: cannot ", "No space left on device")
    parallel_assert(comm, not list(disk.iterdir()))


@pytest.mark.parametrize("size", [1000, RESERVE + 10_000])
def test_files_that_may_not_grow(comm, shared_path, capsys, size):
    """Limit the size of files in place of that of a disk."""
    with file_limit(size):
        code = run(comm, shared_path, shared_path / "out")
    parallel_assert(comm, code == 1)
    told_once(comm, capsys, "error: cannot ", "File too large")
    parallel_assert(comm, not (shared_path / "out").exists())


@pytest.mark.parametrize("name", ["events", "result.h5", "result.json", "path.csv"])
def test_every_file_may_be_the_one_that_does_not_fit(comm, shared_path, capsys, monkeypatch, name):
    """The file is named, and --resume goes on from the events that are kept."""
    if comm.size > 1 and name == "result.h5":
        pytest.skip("as the others; it takes longer on two ranks")
    out, append = shared_path / "out", atomic.append

    def third_is_full(path, *arguments, **kind):
        with atomic.file_errors("write", path):
            if name == "events" and events.count(out) == 2:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        append(path, *arguments, **kind)

    with no_space_for(name), monkeypatch.context() as patch:
        patch.setattr(atomic, "append", third_is_full)
        parallel_assert(comm, run(comm, shared_path, out, PATH) == 1)
    told_once(comm, capsys, "error: cannot write ", f"{name}: No space left on device")
    count = events.count(out)
    parallel_assert(comm, count == 2 if name == "events" else count > 2)
    if name == "result.h5":
        document = json.loads((out / "result.json").read_text())
        assert document["status"] == "incomplete" and "result.h5: No space left on device" in document["faults"][0]
        parallel_assert(comm, cli.main(["report", str(out)]) == 2)
        words = "result.h5: it is missing; run the case again with [output] fields = true and --resume: "
        told_once(comm, capsys, words)
    later = ("result.json", "events")
    parallel_assert(comm, (out / "result.json").exists() == (name not in later) and not (out / name).exists())
    comm.barrier()
    assert run(comm, shared_path, out, PATH, "--resume") == 0
    parallel_assert(comm, json.loads((out / "result.json").read_text())["resumed"] == count)
    parallel_assert(comm, not list(out.glob("*.part")))


def test_pictures_that_do_not_fit_are_reported(comm, shared_path, capsys):
    """The results stay, the old picture too."""
    if comm.size > 1:
        pytest.skip("one rank draws")
    out = shared_path / "out"
    assert run(comm, shared_path, out, PATH) == 0
    (out / "path.gif").write_text("old")
    capsys.readouterr()
    with no_space_for("path.gif"):
        assert cli.main(["plot", str(out)]) == 1
    told_once(comm, capsys, "error: cannot write ", "path.gif: No space left on device")
    assert (out / "path.gif").read_text() == "old" and not list(out.glob("*.part"))


def test_ranks_share_the_pictures_and_report_one_that_does_not_fit(comm, shared_path, capsys):
    """The second picture, which the second rank draws."""
    names, out = ["case_E11.png", "case_E22.png", "case_gamma12.png", "cell.png"], shared_path / "out"
    pictured = CASE.replace("pictures = false", "mesh_error = false")
    with no_space_for("partition.png"):
        parallel_assert(comm, run(comm, shared_path, out, pictured) == 1)
    told_once(comm, capsys, "error: cannot write ", "partition.png: No space left on device")
    parallel_assert(comm, run(comm, shared_path, out, pictured) == 0)
    parallel_assert(comm, sorted(path.name for path in out.glob("*.p*")) == [*names, "partition.png"])


def test_numbers_survive_when_the_fields_do_not_fit(comm, shared_path, capsys):
    """A few states fit; the path is followed to its end all the same, and --resume makes the fields of it."""
    out = shared_path / "out"
    with file_limit(250_000):
        parallel_assert(comm, run(comm, shared_path, out, PATH) == 1)
    told_once(comm, capsys, "error: cannot write ", "result.h5: File too large")
    if comm.rank == 0:
        document = json.loads((out / "result.json").read_text())
        assert document["status"] == "incomplete" and "result.h5: File too large" in document["faults"][0]
        assert document["path"][-1]["load_factor"] == 1.0
        assert (
            "result_h5" not in document
            and "states" not in document
            and not (out / "result.h5").exists()
            and not (out / "result.xdmf").exists()
        )
    comm.barrier()
    assert run(comm, shared_path, out, PATH, "--resume") == 0
    if comm.rank == 0:
        again = json.loads((out / "result.json").read_text())
        assert again["resumed"] == len(document["path"]) and (out / "result.h5").stat().st_size > 250_000
        assert not (out / "checkpoint").exists()
    comm.barrier()


def test_a_log_that_does_not_fit_costs_no_results(comm, shared_path, capsys):
    out = shared_path / "out"
    if comm.rank == 0:
        out.mkdir()
        (out / "events.log").symlink_to("/dev/full")
        (shared_path / "cell.toml").write_text(PATH)
    comm.barrier()
    parallel_assert(comm, cli.main(["run", str(shared_path / "cell.toml"), "--out", str(out)]) == 0)
    lines = [line for line in capsys.readouterr().out.splitlines() if "events.log: No space left on device" in line]
    words = "warning: cannot write ", "the path goes on without it"
    parallel_assert(comm, len(lines) == (comm.rank == 0) and all(word in line for line in lines for word in words))


def test_a_disk_that_another_program_fills_meanwhile(comm, shared_path, small_disk):
    """Reserved space stays; later writes are reported to fail, and closing the file does not crash."""
    disk = small_disk("1M")
    part = part_of(sample(8), comm.rank, comm.size)
    file = FieldFile(disk, comm, part.header, part.mesh, part.fibres, part.interface)
    if comm.rank == 0:
        fill(disk / "other")
    comm.barrier()
    with pytest.raises(FetiHomogError, match=r"^cannot write .*result\.h5: No space left on device$"), file:
        for k in range(100):
            file.write_state(k, part.states[0])
    comm.barrier()
    parallel_assert(comm, [path.name for path in disk.iterdir()] == ["other"])


def fill(path):
    with path.open("wb") as stream:
        try:
            while True:
                os.write(stream.fileno(), b"x" * 4096)
        except OSError:
            pass


def test_a_disk_that_fills_in_the_middle_of_a_sweep(comm, shared_path, capsys):
    """The sweep ends; its finished cases are kept, and the one that was not written is computed again."""
    out = shared_path / "out"
    if comm.rank == 0:
        (shared_path / "sweep.toml").write_text(f"{CASE}[sweep]\ncell.fibre_fraction = [0.2, 0.3]\n")
    comm.barrier()
    words = ["sweep", str(shared_path / "sweep.toml"), "--out", str(out), "--quiet"]
    with no_space_for("case-0002", "result.xdmf"):
        parallel_assert(comm, cli.main(words) == 1)
    errors = capsys.readouterr().err
    parallel_assert(comm, comm.rank > 0 or "result.xdmf: No space left on device" in errors, errors)
    first = (out / "case-0001" / "result.json").stat().st_mtime_ns
    parallel_assert(comm, not (out / "case-0002" / "result.json").exists())
    comm.barrier()
    assert cli.main(words) == 0
    parallel_assert(comm, (out / "case-0001" / "result.json").stat().st_mtime_ns == first)
    parallel_assert(comm, (out / "case-0002" / "result.xdmf").exists())
