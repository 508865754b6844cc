"""Splitting the command line and naming mistyped options."""

import pytest

from feti_homog.feti import solver_plan, thresholds
from feti_homog.system.petsc.option_table import OPTIONS, help_text, unknown_options
from feti_homog.system.petsc.option_values import split_argv


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
    ("name", "words"),
    [
        ("feti_kps_rtol", "-feti_kps_rtol: unknown option; did you mean -feti_ksp_rtol?"),
        ("feti_pctype", "did you mean -feti_pc_type?"),
        ("feti_ksp_", "unknown option"),
        ("feti_zzz", "prefixes: -feti_ksp_, -feti_pc_, "),
    ],
)
def test_misspelt_options_are_reported_with_the_nearest(name, words):
    (fault,) = unknown_options([name, "feti_ksp_rtol"])
    assert words in fault


# Options of PETSc itself pass; misspelt ones, and such as nothing would read, do not.


@pytest.mark.parametrize(
    "name", ["log_view", "malloc_test", "sf_type", "log_view_of_a_release_to_come", "feti_ksp_x", "info"]
)
def test_known_names_pass(name):
    assert unknown_options([name]) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("log_vieww", "did you mean -log_view?"),
        ("log_viev", "did you mean -log_view?"),
        ("options_lef", "did you mean -options_left?"),
        ("mat_type", "options that begin with -feti_"),
        ("prefix_push", "options that begin with -feti_"),
    ],
)
def test_others_are_reported(name, words):
    (fault,) = unknown_options([name])
    assert fault.startswith(f"-{name}: unknown option; ") and words in fault


def test_a_name_without_its_prefix_is_reported():
    fault = "-ksp_rtol: not an option of this program; did you mean -feti_ksp_rtol?"
    assert unknown_options(["ksp_rtol"]) == [fault]
