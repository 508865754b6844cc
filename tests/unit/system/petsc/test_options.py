"""Options of a case below those of the command line, both as they were afterwards, and paths that can be written to."""

import os

import pytest
from petsc4py import PETSc

from feti_homog.system.petsc.option_table import only_prints
from feti_homog.system.petsc.option_values import can_be_written, faulty_values, petsc_words
from feti_homog.system.petsc.options_database import case_options


@pytest.fixture
def given():
    """Set an option (name without dash) of the command line, until the test ends."""
    database, names = PETSc.Options(), []

    def give(name, value):
        names.append(name)
        database.setValue(name, value)

    yield give
    for name in names:
        database.delValue(name)


def test_a_case_without_options_on_the_command_line():
    database = PETSc.Options()
    with case_options({"feti_view": True, "feti_ksp_monitor": False, "feti_ksp_rtol": 1e-5}):
        assert database.hasName("feti_view") and not database.hasName("feti_ksp_monitor")
        assert database.getReal("feti_ksp_rtol") == 1e-5
    assert not any(map(database.hasName, ("feti_view", "feti_ksp_monitor", "feti_ksp_rtol")))


def test_the_command_line_comes_first_and_is_there_for_the_next_case(given):
    given("feti_view", "false")
    given("feti_ksp_monitor", "true")
    given("feti_ksp_rtol", "1e-4")
    database = PETSc.Options()
    for _ in range(2):
        with case_options({"feti_view": True, "feti_ksp_monitor": False, "feti_ksp_rtol": 1e-5}):
            assert database.hasName("feti_ksp_monitor") and not database.hasName("feti_view")
            assert database.getReal("feti_ksp_rtol") == 1e-4
        assert database.getAll().items() >= {"feti_view": "false", "feti_ksp_monitor": "true"}.items()


def test_only_flags_of_petsc_itself_are_settled_when_it_starts():
    words = petsc_words({"log_view": "false", "malloc_debug": "true", "feti_view": "false", "feti_pc_type": "lumped"})
    assert words == ["-malloc_debug", "-feti_view", "false", "-feti_pc_type", "lumped"]


def test_a_missing_options_file_is_said_to_be_missing(tmp_path):
    (tmp_path / "there").touch()
    faults = [faulty_values({"options_file": str(tmp_path / name)})[0] for name in ("there", "none")]
    assert [fault.endswith("there is no such file") for fault in faults] == [False, True]


@pytest.mark.parametrize(
    ("names", "prints"),
    [
        ("ksp_view ksp_view_pre ksp_monitor_true_residual sub_ksp_converged_reason coarse_mat_view", True),
        ("ksp_compute_singularvalues ksp_plot_eigenvalues schur_mat_mumps_icntl_4 sub_mat_cholmod_print view", True),
        ("ksp_type ksp_converged_maxits ksp_max_it pc_type coarse_pc_gamg_threshold schur_mat_mumps_icntl_14", False),
        ("schur_mat_mumps_icntl_7 ksp_error_if_not_converged ksp_converged_use_initial_residual_norm", False),
    ],
)
def test_options_that_print_are_known_by_their_words(names, prints):
    assert [only_prints(f"feti_{name}") for name in names.split()] == [prints] * len(names.split())


NAMES = {
    "new": True, "there": True, "folder": False, "folder/": False, "folder/new": True, "none/new": False,
    "new/": False, "there/": False, "there/new": False, "": False, "a\0b": False, "link to new": True,
    "link to nowhere": False, "link to itself": False, "a" * 300: False, "pipe": False,
}  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "folder").mkdir()
    (tmp_path / "there").touch()
    (tmp_path / "link to new").symlink_to("folder/other")
    (tmp_path / "link to nowhere").symlink_to("none/other")
    (tmp_path / "link to itself").symlink_to("link to itself")
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_names_are_reported_apart(folder, name):
    assert can_be_written(name) is NAMES[name]
    if "\0" not in name and name != "pipe":
        try:
            open(name, "w").close()
            opened = True
        except OSError:
            opened = False
        assert opened is NAMES[name]


def test_a_pipe_can_be_written_while_somebody_reads(folder):
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    assert can_be_written("pipe")
    os.close(reader)
    assert can_be_written("/dev/null")
