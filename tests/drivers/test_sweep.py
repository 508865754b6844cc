"""`feti-homog sweep` and `collect`: finished cases are kept whatever happens, and nothing is mixed."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from support.command_line import command_line, in_process, on_ranks
from support.hooks import WAIT, Hook, HookedJob
from support.jobs import PATIENCE, ROOT, launched
from support.sweep_files import BY_BODIES, CASE, FAILING, FAILING_POINTS, RANDOM, means, rows, sweep_file
from support.sweep_runs import TWO, collected, contents, results, swept

SIX = "cell.fibre_fraction = {from = 0.1, to = 0.3, count = 3}\nmaterial.fibre.young = [150.0, 200.0]\n"


def after_results(count, rank=None):
    """Every rank, or one, waits when it has written so many results."""
    return Hook("feti_homog.results.atomic:commit", WAIT, rank, count, "args[1].name == 'result.json'", after=True)


@pytest.mark.parametrize(("ranks", "words"), [(0, []), (4, ["--ranks-per-case", "2"])])
def test_a_sweep_writes_every_case_at_any_number_of_ranks(tmp_path, ranks, words):
    out = tmp_path / "new" / "sweep"
    job = swept(out, sweep_file(tmp_path, TWO), *words, ranks=ranks)
    assert "2 of 2 cases done; `feti-homog collect" in job.stdout and job.stdout.count("cell.fibre_fraction = 0.3") == 1
    assert {p.name for p in out.iterdir()} == {
        "case-0001", "case-0002", "cases.csv", "sweep.json",
    }  # fmt: skip
    assert {p.name for p in (out / "case-0002").iterdir()} == {"case.toml", "result.json"}
    document = json.loads((out / "case-0002" / "result.json").read_text())
    assert document["case"]["cell"]["fibre_fraction"] == 0.3 and document["solver"]["ranks"] == min(max(ranks, 1), 2)
    case = tomllib.loads((out / "case-0002" / "case.toml").read_text())
    assert case["cell"] == document["case"]["cell"] and case["material"] == document["case"]["material"]
    assert (out / "cases.csv").read_text().splitlines()[2] == "2,case-0002,2,1,0.3"
    before = results(out)
    swept(out, sweep_file(tmp_path, TWO))
    assert results(out) == before


def test_the_case_files_run_by_themselves(tmp_path):
    swept(tmp_path / "out", sweep_file(tmp_path, TWO))
    job = in_process("run", tmp_path / "out/case-0002/case.toml", "--out", tmp_path / "single")
    assert job.returncode == 0, job.stderr
    found = [json.loads((f / "result.json").read_text()) for f in (tmp_path / "out/case-0002", tmp_path / "single")]
    assert found[0]["effective_stiffness"] == found[1]["effective_stiffness"]


def test_list_tells_cases_and_their_state(tmp_path):
    path, out = sweep_file(tmp_path, TWO + "material.matrix.young = [80.0]\n"), tmp_path / "out"
    job = command_line(2, "sweep", path, "--list")
    assert job.stdout.splitlines() == [
        f"case-000{k}  cell.fibre_fraction = 0.{k + 1}, material.matrix.young = 80.0 GPa" for k in (1, 2)
    ]
    swept(out, path, "--index", "2")
    job = in_process("sweep", path, "--out", out, "--list")
    assert [line.split()[1] for line in job.stdout.splitlines()] == ["waiting", "done"]
    assert len(list(tmp_path.glob("**/result.json"))) == 1
    other = sweep_file(tmp_path, TWO + "material.matrix.young = [81.0]\n")
    job = in_process("sweep", other, "--out", out, "--list")
    assert (job.returncode, job.stdout) == (2, "") and f"--out {out} holds another sweep" in job.stderr


@pytest.mark.parametrize(
    ("ranks", "words", "message"),
    [
        (0, [], "arguments are required: --out"),
        (2, ["--out", "results/none", "--index", "3"], "--index 3: expected the number of a case, 1 to 2"),
        (0, ["--out", "results/none", "--index", "0"], "--index 0: expected the number of a case, 1 to 2"),
        (2, ["--out", "results/none", "--ranks-per-case", "3"], "--ranks-per-case 3: expected a divisor of the 2 r"),
        (0, ["--list", "--index", "1"], "not allowed with argument"),
    ],
)
def test_faulty_commands_end_with_2_and_write_nothing(tmp_path, ranks, words, message):
    job = on_ranks(ranks, "sweep", sweep_file(tmp_path, TWO), *words)
    assert job.returncode == 2 and job.stderr.count(message) == 1
    assert not Path(ROOT / "results/none").exists()


def test_faults_of_all_points_are_reported_before_anything_runs(tmp_path):
    path = sweep_file(tmp_path, "cell.fibre_fraction = [0.2, 0.95, 0.99]\n")
    for job in (command_line(2, "sweep", path, "--out", tmp_path / "out"), in_process("check", path)):
        assert job.returncode == 2 and not (tmp_path / "out").exists()
        faults = [line for line in job.stderr.splitlines() if line.startswith("error: ")]
        assert [line.split(":")[1].strip() for line in faults] == ["case-0002", "case-0003"]


def test_a_sweep_is_not_run_as_a_case_nor_a_case_as_a_sweep(tmp_path):
    job = in_process("run", sweep_file(tmp_path, TWO), "--out", tmp_path / "out")
    assert job.returncode == 2 and "`feti-homog sweep` runs them" in job.stderr
    job = in_process("sweep", sweep_file(tmp_path, ""), "--out", tmp_path / "out")
    assert job.returncode == 2 and "`feti-homog run` runs a single case" in job.stderr


def test_check_tells_cases_points_and_ranks(tmp_path):
    job = command_line(2, "check", sweep_file(tmp_path, "realisations = 3\n" + TWO, RANDOM))
    assert job.returncode == 0 and "6 cases, 2 points" in job.stdout and "recommended: " in job.stdout


def test_failed_cases_are_kept_and_reported(tmp_path):
    ranks, out, path = 2, tmp_path / "out", sweep_file(tmp_path, FAILING_POINTS, FAILING)
    job = swept(out, path, "--ranks-per-case", "1", ranks=ranks, code=3)
    assert "1 failed:\n  case-0002  cell.fibre_fraction = 0.745\n    MeshError: " in job.stdout
    assert job.stderr.count("1 of 3 cases failed; --retry computes them again") == 1
    assert sorted(results(out)) == ["case-0001/result.json", "case-0003/result.json"]
    assert (out / "case-0002/error.txt").read_text().startswith("MeshError: ")
    before, failed = results(out), (out / "case-0002/error.txt").stat().st_mtime_ns
    swept(out, path, code=3)
    assert (out / "case-0002/error.txt").stat().st_mtime_ns == failed
    swept(out, path, "--retry", "--ranks-per-case", "1", ranks=ranks, code=3)
    assert (out / "case-0002/error.txt").stat().st_mtime_ns > failed and results(out) == before
    job = swept(out, path, "--index", "2", code=3)
    assert "it failed before" in job.stderr
    assert "2 done, 1 failed" in collected(out).stdout
    assert [row["status"] for row in rows(out)][:3] == ["done", "failed", "done"]


def test_cases_without_convergence_are_computed_again_by_retry_only(tmp_path):
    out, path = tmp_path / "out", sweep_file(tmp_path, TWO, CASE + BY_BODIES)
    job = swept(out, path, "-feti_ksp_max_it", "2", ranks=1, code=3)
    assert job.stdout.count("no convergence after 2 iterations") >= 2
    collected(out)
    assert [row["status"] for row in rows(out)][:2] == ["not converged"] * 2
    swept(out, path, code=3)
    swept(out, path, "--retry")
    collected(out)
    assert [row["status"] for row in rows(out)][:2] == ["done"] * 2
    assert (out / "case-0001/result.json.not_converged").exists() and not (out / "case-0001/error.txt").exists()


def test_a_killed_sweep_goes_on_to_the_same_table(tmp_path):
    """kill -9 twice: no finished case is computed again, and the table is that of a sweep left in peace."""
    path, whole, out = sweep_file(tmp_path, SIX), tmp_path / "whole", tmp_path / "out"
    swept(whole, path)
    assert len(results(whole)) == 6
    kept: dict[str, int] = {}
    for ranks, words, each in ((2, ["--ranks-per-case", "1"], 1), (1, [], 2)):
        with HookedJob(ranks, [after_results(each)], "sweep", path, "--out", out, *words) as job:
            assert {job.reported() for _ in range(ranks)} == {f"{rank} here" for rank in range(ranks)}
            job.killed()
        assert kept.items() <= results(out).items() and len(results(out)) == len(kept) + ranks * each
        kept = results(out)
        assert f"{len(kept)} done" in collected(out).stdout
    job = swept(out, path, "--ranks-per-case", "1", ranks=2)
    assert kept.items() <= results(out).items() and len(results(out)) == 6
    assert job.stdout.count(": done") == 6 - len(kept)
    collected(out)
    collected(whole)
    assert rows(out) == rows(whole) and len(rows(out)) == 6


def test_a_second_sweep_in_the_folder_is_refused_while_the_first_runs(tmp_path):
    """The second is refused while the first runs, even for one case; the first is not disturbed."""
    path, out = sweep_file(tmp_path, TWO), tmp_path / "out"
    with HookedJob(0, [after_results(1)], "sweep", path, "--out", out) as first:
        first.reported()
        kept = results(out)
        for words in ([], ["--index", "2"]):
            job = in_process("sweep", path, "--out", out, *words)
            assert job.returncode == 2 and "this sweep is being run by" in job.stderr
            assert f"process {first.process.pid}" in job.stderr
        assert results(out) == kept and len(kept) == 1
        first.release()
        assert first.ended().returncode == 0 and len(results(out)) == 2


def test_the_folder_of_another_sweep_is_refused(tmp_path):
    out = tmp_path / "out"
    swept(out, sweep_file(tmp_path, TWO))
    before = contents(out)
    other = sweep_file(tmp_path, "cell.fibre_fraction = [0.2, 0.35]\n", name="other")
    for words in ([], ["--index", "1"]):
        job = swept(out, other, *words, code=2)
        assert "holds another sweep: its case-0002 (cell.fibre_fraction = 0.3) differs" in job.stderr
    assert before == contents(out)


def test_more_realisations_keep_those_that_are_there(tmp_path):
    out = tmp_path / "out"
    swept(out, sweep_file(tmp_path, "realisations = 2\n" + TWO, RANDOM))
    before = results(out)
    swept(out, sweep_file(tmp_path, "realisations = 3\n" + TWO, RANDOM))
    assert before.items() <= results(out).items() and len(results(out)) == 6
    job = swept(out, sweep_file(tmp_path, "realisations = 2\n" + TWO, RANDOM), code=2)
    assert "it has 6 cases, this file 4" in job.stderr


def test_jobs_of_an_array_share_the_folder_but_no_case(tmp_path):
    """Different cases of an array share the folder; the same one twice does not."""
    path, out = sweep_file(tmp_path, TWO, CASE + "[petsc]\nfeti_ksp_rtol = 1e-9\n"), tmp_path / "out"
    words = ("-m", "feti_homog", "sweep", path, "--out", out, "--index")
    jobs = [launched(0, *words, str(k), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for k in (1, 2)]
    assert [job.wait(PATIENCE) for job in jobs] == [0, 0] and len(results(out)) == 2
    held = subprocess.Popen(
        [sys.executable, "-c", "import sys; from pathlib import Path\n"
         "from feti_homog.system.runtime.file_locks import Lock\n"
         f"Lock(Path({str(out / 'case-0001/lock')!r})).acquire(); print('held', flush=True); sys.stdin.read()"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert held.stdout is not None and held.stdout.readline() == b"held\n"
    (out / "case-0001/result.json").unlink()
    job = swept(out, path, "--index", "1", code=2)
    assert "--index 1: case-0001 is being computed by" in job.stderr and str(held.pid) in job.stderr
    assert "1 running, 1 done" in collected(out).stdout
    held.kill()
    held.communicate()
    swept(out, path, "--index", "1")


def test_collect_needs_the_folder_of_a_sweep(tmp_path):
    job = in_process("collect", tmp_path)
    assert job.returncode == 2 and "expected the folder of a sweep" in job.stderr


def test_collect_writes_tables_and_pictures(tmp_path):
    out = tmp_path / "out"
    swept(out, sweep_file(tmp_path, "realisations = 3\ncell.fibre_fraction = [0.2, 0.3]\n", RANDOM))
    names = ("cases.csv", "statistics.csv", "moduli.png")
    first, *table, cases, statistics, moduli = collected(out).stdout.splitlines()
    assert (first, cases, statistics, moduli) == ("6 cases: 6 done", *(str(out / name) for name in names))
    printed = [float(line.split()[3]) for line in table if line.startswith("  E1 (GPa)  ")]
    assert printed == pytest.approx(means(out, "E1"), rel=1e-5) and len(printed) == 2
    assert imread(out / "moduli.png")[..., :3].std() > 0.02
    assert [row["status"] for row in rows(out)] == ["done"] * 6
    found = means(out, "bulk")
    bulk, point = (np.array([float(row[name]) for row in rows(out)]) for name in ("bulk", "point"))
    assert found == pytest.approx([bulk[point == 1].mean(), bulk[point == 2].mean()], rel=1e-14)
