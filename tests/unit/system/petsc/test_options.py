"""Options of the command line and of a case: splitting, names, precedence, and paths that can be written to."""

import os

import pytest
from petsc4py import PETSc

from feti_homog.feti import solver_plan, thresholds
from feti_homog.system.petsc.option_table import OPTIONS, help_text, only_prints, unknown_options
from feti_homog.system.petsc.option_values import can_be_written, faulty_values, petsc_words, split_argv
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


@pytest.mark.parametrize(
    ("line", "ours", "petsc"),
    [
        ("run a.toml --out d", "run a.toml --out d", ""),
        ("run a.toml --out d -feti_ksp_rtol 1e-8", "run a.toml --out d", "-feti_ksp_rtol 1e-8"),
        ("run -feti_ksp_max_it 50 a.toml --out d", "run a.toml --out d", "-feti_ksp_max_it 50"),
        ("run a.toml -feti_ksp_monitor --out d", "run a.toml --out d", "-feti_ksp_monitor"),
        ("run a.toml -log_view -options_left", "run a.toml", "-log_view -options_left"),
        ("run a.toml -shift -1.5e-3 --quiet", "run a.toml --quiet", "-shift -1.5e-3"),
        ("run a.toml -shift -.5", "run a.toml", "-shift -.5"),
        ("run a.toml -a x y", "run a.toml y", "-a x"),
        ("-h", "-h", ""),
        ("run -feti_ksp_view -h", "run -h", "-feti_ksp_view"),
        ("-help", "", "-help"),
        ("check --quiet -1", "check --quiet -1", ""),
        ("", "", ""),
        ("run -feti_view a.toml --out d", "run a.toml --out d", "-feti_view"),
        ("run -feti_view true a.toml", "run a.toml", "-feti_view true"),
        ("run -feti_ksp_monitor ascii:m.txt a.toml", "run a.toml", "-feti_ksp_monitor ascii:m.txt"),
        ("plot -log_view ./results", "plot ./results", "-log_view"),
        ("plot -log_view results", "plot", "-log_view results"),
        ("check -feti_ksp_rtol a.toml", "check a.toml", "-feti_ksp_rtol"),
        ("check -options_file a.toml b.toml", "check b.toml", "-options_file a.toml"),
    ],
)
def test_words_with_one_dash_are_petscs_and_the_others_ours(line, ours, petsc, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # whether a word after a flag is its value depends on the folders that there are
    assert split_argv(line.split()) == (ours.split(), petsc.split())


def test_every_option_of_the_table_is_known_and_has_help():
    assert unknown_options(option.name for option in OPTIONS) == []
    assert unknown_options(["feti_ksp_gmres_restart", "feti_sub_mat_mumps_icntl_14", "log_view"]) == []
    own = ["feti_ksp_convergence_test", "feti_ksp_check_norm_iteration", "feti_ksp_initial_guess_nonzero"]
    hint = "the program itself chooses the start, the scaling and the end of the iteration"
    assert unknown_options(own) == [f"-{name}: {hint}" for name in own]
    assert len({option.name for option in OPTIONS}) == len(OPTIONS)
    lines = help_text().splitlines()
    assert len(lines) == len(OPTIONS) + 1
    assert all(f"-{option.name} " in text for option, text in zip(OPTIONS, lines[1:], strict=True))


def test_defaults_are_the_solvers():
    defaults = {option.name: option.default for option in OPTIONS}
    assert float(defaults["feti_ksp_rtol"]) == thresholds.RTOL
    assert int(defaults["feti_ksp_max_it"]) == thresholds.MAX_ITERATIONS
    assert float(defaults["feti_coarse_threshold"]) == thresholds.DEFAULTS.soft_mode


@pytest.mark.parametrize(
    ("name", "value", "default"),
    [
        ("feti_pc_type", solver_plan.PRECONDITIONERS, "auto"),
        ("feti_dual_operator", solver_plan.KINDS, "auto"),
        ("feti_coarse_space", solver_plan.COARSE_SPACES, "auto"),
    ],
)
def test_values_are_the_solvers(name, value, default):
    (option,) = (option for option in OPTIONS if option.name == name)
    assert set(option.value.split("|")) == set(value) and option.default == default


@pytest.mark.parametrize(
    "name", ["log_view", "malloc_test", "sf_type", "log_view_of_a_release_to_come", "feti_ksp_x", "info"]
)
def test_options_of_petsc_itself_pass(name):
    assert unknown_options([name]) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("feti_kps_rtol", "unknown option; did you mean -feti_ksp_rtol?"),
        ("feti_pctype", "unknown option; did you mean -feti_pc_type?"),
        ("feti_ksp_", "unknown option; "),
        ("feti_zzz", "unknown option; prefixes: -feti_ksp_, -feti_pc_, "),
        ("log_vieww", "unknown option; did you mean -log_view?"),
        ("log_viev", "unknown option; did you mean -log_view?"),
        ("options_lef", "unknown option; did you mean -options_left?"),
        ("mat_type", "unknown option; solvers of this program have options that begin with -feti_"),
        ("prefix_push", "unknown option; solvers of this program have options that begin with -feti_"),
        ("ksp_rtol", "not an option of this program; did you mean -feti_ksp_rtol?"),
    ],
)
def test_misspelt_options_and_such_as_nothing_would_read_are_reported(name, words):
    (fault,) = unknown_options([name, "feti_ksp_rtol"])
    assert fault.startswith(f"-{name}: {words}")
