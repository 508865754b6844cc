"""A path that is killed at any moment goes on with --resume, and foreign checkpoints are refused."""

import json
import os
import random
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from support import events
from support.base_case import with_lines
from support.command_line import command_line, in_process, on_ranks
from support.hooks import WAIT, Hook, HookedJob
from support.small_path import SHEET_PATH

COOLED = with_lines(
    SHEET_PATH[: SHEET_PATH.index("[interface]")],
    *('[cell] geometry = "random"', "[cell] fibres = 2", "[cell] seed = 1", "[cell] min_gap = 0.1"),
    *("[cell] mesh_size = 0.15", '[analysis] plane = "generalized"'),
    *("[material.matrix] young = 3.0", "[material.matrix] poisson = 0.35", "[material.matrix] expansion = 6e-5"),
    *("[material.fibre] young = 70.0", "[material.fibre] expansion = 5e-6"),
    *("[interface] normal_stiffness = 60.0", "[interface] tangential_stiffness = 25.0"),
    *('[interface] criterion = "energy"', "[interface] toughness = 4e-6"),
    "[path] waypoints = [{temperature = -100.0}, {S22 = 0.04, S13 = 0.01}, {S22 = -0.01}]",
    *("[output] fields = false", "[output] pictures = false", '[output] states = "all"'),
    '[petsc] feti_pc_type = "influence"',
)
INCREMENTS = 'waypoints = [[0.1, 0.0, 0.0], [-0.05, 0.02, 0.0]]\nmethod = "increments"\nincrements = 24'
LATER_LEGS = "waypoints = [[0.02, 0.0, 0.0], [-0.05, 0.02, 0.0], [0.1, 0.0, 0.0]]"
TEETH = """\
law = "bilinear"
normal_stiffness = 4000.0
tangential_stiffness = 3000.0
normal_toughness = 0.01
tangential_toughness = 0.02
teeth = 3
normal_strength = 4.0"""
# What is changed in a case, by the key of its line.
KINDS = {"increments": {"strain": INCREMENTS}, "later legs": {"strain": LATER_LEGS}}
KINDS["softening"] = {"mesh_size": "mesh_size = 0.2", "normal_strength": TEETH}
SOLVE = "feti_homog.feti.solver:FetiSolver.solve"


def case_file(folder: Path, name: str = "case", **changes: str) -> Path:
    text = SHEET_PATH
    for old, new in changes.items():
        text = re.sub(rf"^{old} = .*$", new, text, flags=re.MULTILINE)
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def document(out: Path):
    return json.loads((out / "result.json").read_text())


def killed(ranks: int, case: Path, out: Path, at: int, *words: str, moment: str = "kept") -> int:
    """Run until there are `at` events, and in the moment of `MOMENTS`, then kill -9; returns how many are there."""
    with HookedJob(ranks, [MOMENTS[moment](out, at)], "run", case, "--out", out, *words) as job:
        assert job.reported() == "0 here"
        job.killed()
    return events.count(out)


WRITE = "feti_homog.results.checkpoints:Checkpoint.write"
COUNT = (
    "os.path.exists('{0}') and "
    "len([*__import__('feti_homog.results.checkpoints', fromlist=['records'])"
    ".records(__import__('pathlib').Path('{0}'))]) - 1"
)
# When a path is killed: the last of so many events has just been kept, or the next is written or computed.
MOMENTS = {
    "kept": lambda _, at: Hook(WRITE, WAIT, when=f"args[1] == {at - 1}", after=True),
    "written": lambda _, at: Hook(WRITE, WAIT, when=f"args[1] == {at}"),
    "computed": lambda out, at: Hook(SOLVE, WAIT, when=f"{COUNT.format(out / 'checkpoint/events')} == {at}"),
}


def assert_same_curve(found, expected):
    assert len(found) == len(expected)
    for key in ("load_factor", "strain", "stress", "dissipated", "dissipated_strain_controlled"):
        a, b = (np.array([point[key] for point in points]) for points in (found, expected))
        assert np.abs(a - b).max() <= 1e-6 * np.abs(b).max(), key
    for key in ("broke", "bonded", "open", "closed"):
        assert [point[key] for point in found] == [point[key] for point in expected], key


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Provide the uninterrupted run."""
    folder = tmp_path_factory.mktemp("reference")
    job = in_process("run", case_file(folder), "--out", folder / "out")
    assert job.returncode == 0, job.stderr
    return folder / "out"


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Provide a folder with some events of an ended run."""
    folder = tmp_path_factory.mktemp("interrupted")
    assert killed(0, case_file(folder), folder / "out", 5) == 5
    return folder / "out"


def test_a_path_killed_again_and_again_ends_as_one_left_in_peace(tmp_path, reference):
    ranks, chance, case, out = 2, random.Random(2), case_file(tmp_path), tmp_path / "out"
    expected, last = document(reference), 0
    for moment in ("kept", "written", "computed"):
        last += chance.randint(1, 12)
        assert killed(ranks, case, out, last, *(["--resume"] if moment != "kept" else []), moment=moment) == last
        assert not (out / "result.json").exists()
    job = command_line(ranks, "run", case, "--out", out, "--resume")
    assert job.returncode == 0, job.stderr
    found = document(out)
    assert f"{last} events are taken from the checkpoint" in job.stdout and found["resumed"] == last
    log = (out / "events.log").read_text().splitlines()
    assert [", from the checkpoint: " in line for line in log[1:]] == [n < last for n in range(len(found["path"]))]
    assert found["states"] == expected["states"]
    assert_same_curve(found["path"], expected["path"])
    # A finished event costs no solve: those left took at least one each, and no more than in the whole run.
    assert len(found["path"]) - last <= found["solver"]["solves"] <= expected["solver"]["solves"] - last
    assert not (out / "checkpoint").exists()


@pytest.mark.parametrize(("ranks", "kind"), [(2, "increments"), (0, "later legs"), (0, "softening")])
def test_paths_of_every_kind_resume(tmp_path, ranks, kind):
    case = case_file(tmp_path, **KINDS[kind])
    assert in_process("run", case, "--out", tmp_path / "whole").returncode == 0
    softens = kind == "softening"
    count = killed(ranks, case, tmp_path / "out", 12 if softens else 8)
    job = on_ranks(ranks, "run", case, "--out", tmp_path / "out", "--resume")
    assert job.returncode == 0, job.stderr
    found, expected = (document(tmp_path / name) for name in ("out", "whole"))
    kept = found["resumed"]
    assert count == kept == (12 if softens else 8) < len(expected["path"])
    assert_same_curve(found["path"], expected["path"])
    if softens:
        assert sum(point["softened"] for point in expected["path"][:kept]) > 0
        for key in ("softened", "fracture_energy", "damaged_share"):
            np.testing.assert_allclose(*([point[key] for point in of["path"]] for of in (found, expected)), rtol=1e-6)


def test_a_cooled_path_in_space_resumes(tmp_path):
    """Killed on its first leg beyond the cooling, where bonds break by energy, faces touch, and stresses are given."""
    case = tmp_path / "case.toml"
    case.write_text(COOLED)
    job = in_process("run", case, "--out", tmp_path / "whole")
    assert job.returncode == 0, job.stderr
    expected = document(tmp_path / "whole")["path"]
    kept = killed(0, case, tmp_path / "out", len(expected) // 2)
    assert expected[kept - 1]["load_factor"] > 0.34 and kept < len(expected)
    job = in_process("run", case, "--out", tmp_path / "out", "--resume")
    assert job.returncode == 0, job.stderr
    found = document(tmp_path / "out")
    assert found["resumed"] == kept
    assert_same_curve(found["path"], expected)
    for key in ("temperature", "work", "stored", "stored_in_springs", "fracture_energy", "debonded_length"):
        a, b = (np.array([point[key] for point in points]) for points in (found["path"], expected))
        assert np.abs(a - b).max() <= 1e-6 * np.abs(b).max(), key
    assert sum(point["broke"] for point in expected) > 20 and any(point["closed"] for point in expected)


def test_a_finished_run_is_left_alone(tmp_path, reference):
    before = {path.name: path.stat().st_mtime_ns for path in reference.iterdir()}
    job = in_process("run", case_file(tmp_path, name="again"), "--out", reference, "--resume")
    assert job.returncode == 0 and "nothing to do" in job.stdout
    assert before == {path.name: path.stat().st_mtime_ns for path in reference.iterdir()}


def test_an_interrupted_path_says_what_is_kept(tmp_path):
    out = tmp_path / "out"
    with HookedJob(0, [Hook(WRITE, WAIT, when="args[1] == 2")], "run", case_file(tmp_path), "--out", out) as job:
        assert job.reported() == "0 here"
        job.process.terminate()
        ended = job.ended()
    line = f"2 points are in {out}: `plot {out}` draws them; to go on, add --resume to `run`; a study goes on by itself"
    assert ended.stderr == f"interrupted by SIGTERM\n{line}\n" and events.count(out) == 2


def test_without_checkpoint_or_resume_a_run_begins_anew(tmp_path, interrupted):
    coarse = case_file(tmp_path, name="coarse", mesh_size="mesh_size = 0.2")
    job = in_process("run", coarse, "--out", tmp_path / "new", "--resume")
    assert job.returncode == 0 and "no events are stored" in job.stdout
    shutil.copytree(interrupted, out := tmp_path / "old")
    job = in_process("run", case_file(tmp_path), "--out", out)
    way = f"--resume goes on from them; remove {out / 'checkpoint'} to start again"
    assert job.returncode == 2 and f"error: --out {out}: it holds 5 events of this path: {way}\n" in job.stderr
    before, after = ({path.relative_to(of) for path in of.rglob("*")} for of in (interrupted, out))
    assert events.count(out) == 5 and before == after


@pytest.mark.parametrize(
    ("ranks", "changes", "message"),
    [
        (0, {"normal_strength": "normal_strength = 4.1"}, "differs in interface.normal_strength: 4.0 now 4.1; choose"),
        (0, {"strain": "waypoints = [[0.2, 0.0, 0.0], [0.1, 0.0, 0.05]]"}, "path.waypoints.2.2: none now 0.0, "),
        (0, {"refine": "refine = 1"}, "differs in cell.refine: 0 now 1; choose"),
        (2, {}, "of a run on 1 ranks; go on with as many (--ranks"),
        (0, {r"\[output\]": "[decomposition]\nsubdomains = 4\n\n[output]"}, "decomposition.subdomains: "),
    ],
)
def test_checkpoints_of_another_case_are_refused(tmp_path, interrupted, ranks, changes, message):
    shutil.copytree(interrupted, tmp_path / "out")
    text = SHEET_PATH
    for old, new in changes.items():
        text, count = re.subn(rf"^{old}.*$", new, text, flags=re.MULTILINE)
        assert count == 1
    (tmp_path / "case.toml").write_text(text)
    kept = events.count(tmp_path / "out")
    job = on_ranks(ranks, "run", tmp_path / "case.toml", "--out", tmp_path / "out", "--resume")
    assert job.returncode == 2 and message in job.stderr and "Traceback" not in job.stderr
    assert job.stderr.count("error: --resume:") == 1 and "coarse triangles" not in job.stdout  # before meshing
    assert events.count(tmp_path / "out") == kept


def test_a_path_does_not_go_on_with_another_mesh(tmp_path):
    """A user's mesh whose file has changed since the run that left the checkpoint."""
    meshes, mesh = Path(__file__).parents[2] / "meshes", tmp_path / "cell.msh"
    own = SHEET_PATH.replace(
        'geometry = "square"\nfibre_fraction = 0.4\nmesh_size = 0.06', 'geometry = "mesh"\nfile = "cell.msh"'
    )
    (tmp_path / "case.toml").write_text(own.replace("[path]\n", "[path]\nmax_events = 2\n"))
    words = ("run", tmp_path / "case.toml", "--out", tmp_path / "out")
    shutil.copy(meshes / "square.msh", mesh)
    in_process(*words)
    kept = events.count(tmp_path / "out")
    shutil.copy(meshes / "two_fibres.msh", mesh)
    job = in_process(*words, "--resume")
    assert kept > 0 and job.returncode == 2 and "holds the events of another" in job.stderr
    assert "Traceback" not in job.stderr and events.count(tmp_path / "out") == kept


@pytest.mark.parametrize("damage", ["garbage", "overwritten"])
def test_unreadable_checkpoints_are_refused(tmp_path, interrupted, damage):
    shutil.copytree(interrupted, tmp_path / "out")
    path = tmp_path / "out" / "checkpoint" / "events"
    if damage == "garbage":
        path.write_bytes(os.urandom(3000))
    else:
        content = path.read_bytes()
        path.write_bytes(content[:1000] + bytes(100) + content[1100:])
    job = in_process("run", case_file(tmp_path), "--out", tmp_path / "out", "--resume")
    assert job.returncode == 2 and "--resume: " in job.stderr and "checkpoint/events is damaged" in job.stderr
    assert "Traceback" not in job.stderr


def test_only_paths_resume(tmp_path):
    from support.command_line import case_file as stiffness_case

    job = in_process("run", stiffness_case(tmp_path), "--out", tmp_path / "out", "--resume")
    assert job.returncode == 2 and '--resume: only for [analysis] type = "path"' in job.stderr
