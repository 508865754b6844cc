"""PETSc's options on the command line: those of the table are accepted by every run, misspelt ones are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.command_line import case_file, command_line
from support.hooks import Hook, hooked

from feti_homog.petsc.option_table import OPTIONS

PREFIXES = ("natural", "coarse", "bonded", "sub", "interior")
WITHOUT_CHOLMOD = [word for p in PREFIXES for word in (f"-feti_{p}_pc_factor_mat_solver_type", "mumps")]
CUT = "[output]\npictures = false\n[decomposition]\nsubdomains = 6\n"
# A value that each kind of option takes; what is listed takes its default.
VALUES = {"<real>": "1e-8", "<integer>": "50", "": None}


@pytest.fixture(scope="module")
def stiffness(tmp_path_factory):
    """L^ef with the default options."""
    folder = tmp_path_factory.mktemp("default")
    job = command_line(1, "run", case_file(folder, CUT), "--out", folder / "out", "--quiet")
    assert job.returncode == 0, job.stderr
    return np.array(json.loads((folder / "out/result.json").read_text())["effective_stiffness"])


def assert_runs(tmp_path, ranks, words, stiffness):
    job = command_line(ranks, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", "--quiet", *words)
    assert (job.returncode, job.stderr) == (0, "")
    found = np.array(json.loads((tmp_path / "out/result.json").read_text())["effective_stiffness"])
    assert np.abs(found - stiffness).max() < 1e-6 * np.abs(stiffness).max()


@pytest.mark.parametrize(
    "others",
    [[], ["-feti_dual_operator", "implicit"], ["-feti_pc_type", "influence"], ["-feti_coarse_space", "natural"]],
    ids=["default", "implicit", "influence", "natural"],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_petsc_without_cholmod(tmp_path, stiffness, ranks, others):
    """Every factorization by MUMPS, whichever of them the run makes; it writes fields, which need the interiors."""
    assert_runs(tmp_path, ranks, [*WITHOUT_CHOLMOD, *others], stiffness)


def test_every_option_of_the_table_is_accepted(tmp_path, stiffness):
    words = []
    for option in OPTIONS:
        value = VALUES.get(option.value, option.default)
        words += [f"-{option.name}"] + ([value] if value else [])
    job = command_line(1, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *words)
    assert job.returncode == 0, job.stderr
    found = np.array(json.loads((tmp_path / "out/result.json").read_text())["effective_stiffness"])
    assert np.abs(found - stiffness).max() < 1e-6 * np.abs(stiffness).max()


def test_options_of_the_library_of_a_solver_that_the_run_does_not_make(tmp_path, stiffness):
    """MUMPS' own options are read once MUMPS is chosen; the run makes no implicit subdomains."""
    words = ["-feti_sub_pc_factor_mat_solver_type", "mumps", "-feti_sub_mat_mumps_icntl_14", "60"]
    assert_runs(tmp_path, 1, words, stiffness)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["-feti_sub_pc_factor_mat_solver_typ", "mumps"], "did you mean -feti_sub_pc_factor_mat_solver_type?"),
        (["-feti_interior_pc_factor_mat_solvertype", "mumps"], "-feti_interior_pc_factor_mat_solver_type?"),
        (["-feti_bonded_typ", "mumps"], "-feti_bonded_typ: no solver has such an option"),
        (["-feti_coarse_spase", "natural"], "did you mean -feti_coarse_space?"),
        (["-feti_pctype", "lumped"], "did you mean -feti_pc_type?"),
        (["-feti_projected_pc_type", "none"], "-feti_projected_pc_type: unknown option"),
        (["-feti_sub_mat_mumps_icntl_14", "60"], "-feti_sub_mat_mumps_icntl_14: no solver has such an option"),
        (
            ["-feti_interior_pc_factor_mat_solver_type", "nolib", "-feti_interior_x", "1"],
            "-feti_interior_pc_factor_mat_solver_type nolib -feti_interior_x 1: ",
        ),
        (["-feti_pc_type", "ilu"], "expected one of auto, none, lumped, dirichlet, influence"),
    ],
)
def test_misspelt_options_are_refused(tmp_path, words, fault):
    job = command_line(1, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *words)
    assert job.returncode == 2, job.stderr
    assert fault in job.stderr and not (tmp_path / "out").exists()
    assert "Traceback" not in job.stderr


def test_misspelt_options_of_a_case_file_are_refused(tmp_path):
    path = case_file(tmp_path, CUT + "[petsc]\nfeti_interior_pc_factor_mat_solver_typ = 'mumps'\n")
    job = command_line(2, "run", path, "--out", tmp_path / "out")
    assert job.returncode == 2
    assert job.stderr.count("did you mean -feti_interior_pc_factor_mat_solver_type?") == 1


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["-feti_pc_type", "ilu"], "-feti_pc_type ilu: expected one of auto, none"),
        (["-feti_dual_operator", "direct"], "-feti_dual_operator direct: expected one of auto, implicit, explicit"),
        (["-feti_coarse_space", "deluxe"], "-feti_coarse_space deluxe: expected one of auto, natural, adaptive"),
        (["-feti_coarse_threshold", "1.5"], "-feti_coarse_threshold 1.5: expected a number above 0 and below 1"),
        (["-feti_ksp_rtol"], "-feti_ksp_rtol: expected a number"),
        (["-feti_ksp_max_it", "0"], "-feti_ksp_max_it 0: expected an integer of at least 1"),
        (["-feti_ksp_type", "cgg"], "-feti_ksp_type cgg: PETSc has no such Krylov method"),
        (["-feti_ksp_rtoll", "1e-3"], "-feti_ksp_rtoll: no solver has such an option; did you mean -feti_ksp_rtol?"),
        (["-feti_pc_typ", "none"], "-feti_pc_typ: no solver has such an option; did you mean -feti_pc_type?"),
        (["-feti_interior_pc_typ", "lu"], "-feti_interior_pc_typ: no solver has such an option; did you mean"),
        (["-feti_sub_pc_factor_mat_solver_type", "x"], "-feti_sub_pc_factor_mat_solver_type x: "),
        (["-feti_interior_pc_type", "x"], "-feti_interior_pc_type x: "),
    ],
)
def test_options_are_checked_before_the_work(tmp_path, words, fault):
    job = command_line(1, "check", case_file(tmp_path, CUT), *words)
    assert (job.returncode, job.stdout) == (2, "")
    assert fault in job.stderr and job.stderr.count("error: ") == 1


@pytest.mark.parametrize(
    "words",
    [
        ["-log_view", "ascii:none/"], ["-log_view", ":none/"], ["-feti_ksp_monitor", "ascii:none/"],
        ["-info", "none/"], ["-malloc_view", "none/"], ["-malloc_test", "maybe"], ["-log_vieww"], ["-mat_type", "foo"],
        ["-prefix_push", "a"], ["-feti_natural_ksp_rtol", "2"], ["-options_file", "pyproject.toml"],
        ["-skip_petscrc", "maybe"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_options_that_nobody_could_take_are_one_line(tmp_path, words):
    job = command_line(2, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *words)
    assert job.returncode == 2 and not (tmp_path / "out").exists()
    assert job.stderr.startswith(f"error: {words[0]}")
    assert job.stderr.count("error: ") == 1 and "PETSC ERROR" not in job.stderr


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_log_that_cannot_be_written_any_more_hangs_no_rank(tmp_path, ranks):
    """Its folder goes when pictures are drawn; PETSc opens the file when it ends, the others wait for that."""
    case, log, out = case_file(tmp_path, ""), tmp_path / "logs", tmp_path / "out"
    log.mkdir()
    hook = Hook("feti_homog.report.plots.figures:plot", f"os.rmdir({str(log)!r})")
    job = hooked(ranks, [hook], "run", case, "--out", out, "-log_view", f":{log}/log.txt")
    assert job.returncode == 1 and "error: PETSc cannot end" in job.stderr
    assert json.loads((out / "result.json").read_text())["status"] == "done"


def test_options_that_petsc_alone_knows_pass(tmp_path):
    words = ["-feti_ksp_monitor_true_residual", "-feti_sub_pc_factor_mat_ordering_type", "nd", "-feti_ksp_type", "fcg"]
    job = command_line(1, "check", case_file(tmp_path, CUT), *words)
    assert (job.returncode, job.stderr) == (0, "")
