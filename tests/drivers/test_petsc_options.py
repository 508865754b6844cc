"""PETSc's options on the command line: those of the table are accepted by every run, misspelt ones are refused."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from support.command_line import case_file, command_line, in_process
from support.hooks import Hook, hooked
from support.jobs import PATIENCE, environment

from feti_homog.system.petsc.option_table import OPTIONS

PREFIXES = ("natural", "coarse", "bonded", "sub", "interior")
WITHOUT_CHOLMOD = [word for p in PREFIXES for word in (f"-feti_{p}_pc_factor_mat_solver_type", "mumps")]
CUT = "[output]\npictures = false\n[decomposition]\nsubdomains = 6\n"
# A value that each kind of option takes; what is listed takes its default.
VALUES = {"<real>": "1e-8", "<integer>": "50", "": None}


@pytest.fixture(scope="module")
def stiffness(tmp_path_factory):
    """L^ef with the default options."""
    folder = tmp_path_factory.mktemp("default")
    job = in_process("run", case_file(folder, CUT), "--out", folder / "out", "--quiet")
    assert job.returncode == 0, job.stderr
    return np.array(json.loads((folder / "out/result.json").read_text())["effective_stiffness"])


def assert_runs(tmp_path, ranks, words, stiffness):
    job = command_line(ranks, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", "--quiet", *words)
    assert (job.returncode, job.stderr) == (0, "")
    found = np.array(json.loads((tmp_path / "out/result.json").read_text())["effective_stiffness"])
    assert np.abs(found - stiffness).max() < 1e-6 * np.abs(stiffness).max()


@pytest.mark.parametrize(
    ("ranks", "others"),
    [
        (2, []),
        (1, ["-feti_dual_operator", "implicit", "-feti_coarse_space", "natural"]),
        (1, ["-feti_pc_type", "influence"]),
    ],
)
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


# What is wrong with options, by when they are refused: with these words, in one line each.
REFUSED = {
    "values": {
        "-feti_schur_mat_mumps_icntl_19 0": "no such option: MUMPS would not condense",
        "-feti_schur_mat_mumps_icntl_28 2": "0 or 1, because one rank analyses its matrices",
        "-feti_pc_type ilu": "expected one of auto, none, lumped, dirichlet, influence",
        "-feti_dual_operator direct": "expected one of auto, implicit, explicit",
        "-feti_coarse_space deluxe": "expected one of auto, natural, adaptive",
        "-feti_coarse_threshold 1.5": "expected a number above 0 and below 1",
        "-feti_ksp_rtol": "expected a number",
        "-feti_ksp_max_it 0": "expected an integer of at least 1",
        "-feti_influence_columns -1": "expected an integer of at least 1",
        "-feti_ksp_type preonly": "expected a method that iterates, such as cg",
        "-feti_ksp_norm_type none": "expected preconditioned, unpreconditioned or natural",
        "-feti_interior_pc_type x": "expected one of cholesky, lu",
    },
    "unknown": {
        "-feti_projected_pc_type none": "unknown option",
        "-feti_pctype lumped": "unknown option; did you mean -feti_pc_type?",
    },
    "solvers": {
        "-feti_ksp_type cgg": "PETSc has no such Krylov method",
        "-feti_natural_pc_type gamg": "preonly needs a factorization; add -feti_natural_ksp_type cg",
        "-feti_coarse_pc_type ilu": "preonly needs a factorization; add -feti_coarse_ksp_type cg",
        "-feti_sub_pc_factor_mat_solver_type x": "",
        "-feti_schur_mat_mumps_icntl_8 -1": "INFOG(1)=-22",  # scaling by vectors that no option gives
        "-feti_interior_pc_factor_mat_solver_type nolib -feti_interior_x 1": "",
    },
    "unread": {
        "-feti_ksp_rtoll 1e-3": "no solver has such an option; did you mean -feti_ksp_rtol?",
        "-feti_pc_typ none": "no solver has such an option; did you mean -feti_pc_type?",
        "-feti_coarse_spase natural": "did you mean -feti_coarse_space?",
        "-feti_interior_pc_typ lu": "no solver has such an option; did you mean",
        "-feti_sub_pc_factor_mat_solver_typ mumps": "did you mean -feti_sub_pc_factor_mat_solver_type?",
        "-feti_interior_pc_factor_mat_solvertype mumps": "did you mean -feti_interior_pc_factor_mat_solver_type?",
    },
}
# Known when all solvers of a run are set up.
UNREAD = {
    "-feti_bonded_typ mumps": "no solver has such an option",
    "-feti_sub_mat_mumps_icntl_14 60": "no solver has such an option",
}


@pytest.mark.parametrize(
    ("kind", "command"),
    [("values", "check"), ("unknown", "run"), ("solvers", "check"), ("solvers", "run"), ("unread", "run")],
)
def test_options_are_refused_before_the_work(tmp_path, kind, command):
    """All of a kind at once, each in a line."""
    ranks = int(command == "run")
    out = ["--out", tmp_path / "out"] if command == "run" else []
    job = command_line(ranks, command, case_file(tmp_path, CUT), *out, *words_of(REFUSED[kind]))
    assert job.stdout == ""
    assert_refused(job, REFUSED[kind], tmp_path / "out")


def test_options_that_no_solver_reads_are_refused(tmp_path):
    job = command_line(1, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *words_of(UNREAD))
    assert_refused(job, UNREAD, tmp_path / "out")


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("prefix", "words"),
    [
        ("natural", "-feti_natural_pc_type none -feti_natural_ksp_max_it 2"),
        ("sub", "-feti_sub_pc_type lu -feti_dual_operator implicit -feti_sub_ksp_max_it 1 -feti_sub_ksp_rtol 1e-30"),
    ],
)
def test_an_inner_solve_that_does_not_converge_names_its_options(tmp_path, ranks, prefix, words):
    chosen = [f"-feti_{prefix}_ksp_type", "cg", *words.split()]
    job = command_line(ranks, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *chosen)
    (line,) = (line for line in job.stderr.splitlines() if line.startswith("error: "))
    assert job.returncode == 3 and "Traceback" not in job.stderr
    assert line.startswith(f"error: -feti_{prefix}_ksp_type cg: no convergence (KSPConvergedReason -3, iterations: ")
    assert f"raise -feti_{prefix}_ksp_max_it" in line


def words_of(options):
    return [word for option in options for word in option.split()]


def assert_refused(job, faults, out):
    lines = [line for line in job.stderr.splitlines() if line.startswith("error: ")]
    assert job.returncode == 2 and not out.exists() and "Traceback" not in job.stderr, job.stderr
    assert len(lines) == len(faults), lines
    for option, fault in faults.items():
        assert any(re.match(rf"error: {option.split()[0]}\b", line) and fault in line for line in lines), option


def test_misspelt_options_of_a_case_file_are_refused(tmp_path):
    path = case_file(tmp_path, CUT + "[petsc]\nfeti_interior_pc_factor_mat_solver_typ = 'mumps'\n")
    job = command_line(2, "run", path, "--out", tmp_path / "out")
    assert job.returncode == 2
    assert job.stderr.count("did you mean -feti_interior_pc_factor_mat_solver_type?") == 1


@pytest.mark.parametrize(
    ("ranks", "options"),
    [
        (2, ["-log_view ascii:none/", "-feti_ksp_monitor ascii:none/", "-info none/", "-malloc_view none/",
         "-malloc_test maybe", "-feti_natural_ksp_rtol 2", "-skip_petscrc maybe", "-log_vieww", "-mat_type foo",
         "-prefix_push a"]),
        (0, ["-log_view :none/", "-options_file pyproject.toml"]),
    ],
    ids=["values and names", "files"],
)  # fmt: skip
def test_options_that_nobody_could_take_are_a_line_each(tmp_path, ranks, options):
    job = command_line(ranks, "run", case_file(tmp_path, CUT), "--out", tmp_path / "out", *words_of(options))
    assert job.returncode == 2 and not (tmp_path / "out").exists()
    lines = [line for line in job.stderr.splitlines() if line.startswith("error: ")]
    assert sorted(line.split()[1].rstrip(":") for line in lines) == sorted(option.split()[0] for option in options)
    assert "PETSC ERROR" not in job.stderr


def test_a_log_that_cannot_be_written_any_more_hangs_no_rank(tmp_path):
    """Its folder goes when pictures are drawn; PETSc opens the file when it ends, the others wait for that."""
    case, log, out = case_file(tmp_path, ""), tmp_path / "logs", tmp_path / "out"
    log.mkdir()
    hook = Hook("feti_homog.report.plots.figures:draw", f"os.rmdir({str(log)!r})", rank=0)
    job = hooked(2, [hook], "run", case, "--out", out, "-log_view", f":{log}/log.txt")
    assert job.returncode == 1 and "error: PETSc cannot end" in job.stderr
    assert json.loads((out / "result.json").read_text())["status"] == "done"


def test_options_that_petsc_alone_knows_pass(tmp_path):
    words = ["-feti_ksp_monitor_true_residual", "-feti_sub_pc_factor_mat_ordering_type", "nd", "-feti_ksp_type", "fcg"]
    job = command_line(1, "check", case_file(tmp_path, CUT), *words)
    assert (job.returncode, job.stderr) == (0, "")


def test_solvers_that_python_keeps_to_its_end_do_not_outlive_petsc(tmp_path):
    """Also if another module, here that of temporary folders, had finalizers before PETSc began."""
    case = str(case_file(tmp_path, CUT))
    lines = (
        "import tempfile; folder = tempfile.TemporaryDirectory()",
        f"import feti_homog as f; from feti_homog import cli; f.run(f.Case.load({case!r}), quiet=True)",
        "from feti_homog.feti.linalg.sparse_direct import DirectSolver; from scipy.sparse import eye",
        "kept = DirectSolver(eye(5).tocsr(), 'feti_sub_'); print('kept')",
        f"cli.main(['run', {case!r}, '--out', {str(tmp_path / 'out')!r}, '--quiet'])",  # starts PETSc, too
    )
    words, options = [sys.executable, "-c", "\n".join(lines)], {"capture_output": True, "text": True}
    job = subprocess.run(words, env=environment(), timeout=PATIENCE, check=False, **options)
    assert (job.returncode, job.stdout, job.stderr) == (0, "kept\n", "")
