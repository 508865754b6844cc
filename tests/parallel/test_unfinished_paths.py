"""The points of an interrupted path equal the first points of the finished path, for every reader."""

import csv
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from mpi4py import MPI
from support.ranks import PIECES, parallel_assert

from feti_homog import Case, run, run_sweep
from feti_homog.analysis import stepped_progress
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.report import page
from feti_homog.report.cards import export
from feti_homog.report.plots import figures, path_picture
from feti_homog.results import checkpoints, field_file, output_folder, result_json
from feti_homog.studies import case_folders, case_runs, collect, sweep_cases
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.system.runtime import file_locks

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

EVENTS = 6
CASE: dict[str, Any] = {
    "name": "sheet",
    "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
    "material": {"matrix": {"young": 100.0, "poisson": 0.4}, "fibre": {"young": 500.0, "poisson": 0.2}},
    "analysis": {"type": "path", "plane": "stress"},
    "interface": {"normal_strength": 4.0, "tangential_strength": 3.0},
    "path": {"strain": [0.2, 0.0, 0.05]},
    "decomposition": PIECES,
    "output": {"pictures": False, "states": 2},
}
LEGS = {"waypoints": [[0.1, 0.0, 0.0], [-0.05, 0.02, 0.0]]}
PATHS = {"events": CASE["path"], "legs": LEGS, "increments": LEGS | {"method": "increments", "increments": 12}}
# Entries that the end of a path adds to some points.
AT_END = {"mark", "mesh_error", "tips", "debonded_length", "debonding_angle"}


def interrupted(at: int = EVENTS, of: str = "") -> Any:
    """End a run, whose folder has `of` in its path, after so many events."""
    write = checkpoints.Checkpoint.write

    def written(self: checkpoints.Checkpoint, number: int, *event: Any) -> None:
        write(self, number, *event)
        if number == at - 1 and of in str(self.path):
            raise RuntimeError("interrupted")

    return mock.patch.object(checkpoints.Checkpoint, "write", written)


def begun(comm: Any, folder: Path, path: dict[str, Any]) -> None:
    with interrupted(), pytest.raises(RuntimeError, match="interrupted"):
        run(Case.parse(CASE | {"path": path}), comm, out=folder)
    comm.barrier()


@pytest.mark.parametrize("kind", PATHS)
def test_points_so_far_are_those_of_the_finished_path(comm, shared_path, kind):
    case, out = Case.parse(CASE | {"path": PATHS[kind]}), shared_path / "out"
    begun(comm, out, PATHS[kind])
    so_far = on_root(comm, output_folder.latest, out)
    run(case, comm, out=shared_path / "whole")
    whole = on_root(comm, result_json.read, shared_path / "whole")
    expected = [{k: v for k, v in point.items() if k not in AT_END} for point in whole["path"]]
    assert len(expected) > EVENTS and so_far["path"] == expected[:EVENTS]
    assert {k: so_far[k] for k in ("case", "digest", "cell")} == {k: whole[k] for k in ("case", "digest", "cell")}
    largest = max(point["load_factor"] for point in expected[:EVENTS])
    assert so_far["status"] == f"unfinished, {EVENTS} points up to load {largest:.4f}"
    run(case, comm, out=out, resume=True)
    assert on_root(comm, output_folder.latest, out)["status"] == "done"


def test_an_interrupted_run_leaves_no_file_to_the_garbage_collection(comm, shared_path):
    """One rank alone would close the file, and wait for the others."""

    def files() -> set[int]:
        return {id(item) for item in gc.get_objects() if isinstance(item, field_file.FieldFile)}

    gc.collect()
    gc.disable()
    try:
        before = files()
        begun(comm, shared_path, CASE["path"])
        left = files() - before
    finally:
        gc.enable()
    parallel_assert(comm, not left)


@pytest.mark.one_rank
def test_curves_and_page_tell_that_the_path_is_unfinished(comm, shared_path):
    begun(comm, shared_path, CASE["path"])

    def drawn() -> list[str]:
        paths = figures.plot(shared_path)
        text = page.write(shared_path).read_text()
        (title, status, _) = path_picture.figure(output_folder.latest(shared_path)).axes[0].get_title().split("\n")
        assert status.startswith("unfinished, 6 points") and status in text and title.startswith("sheet")
        assert "Largest S11 so far, the path being cut off" in text
        return sorted(path.name for path in paths)

    assert on_root(comm, drawn) == ["energy.png", "path.png"]


DAMAGED = '{"version": "", "case": {}, "solver": {}}'


def test_a_run_that_does_not_resume_leaves_the_events_of_its_case(comm, shared_path):
    """Also where a result has all points, and a result.json is damaged; not where nothing goes on from the events."""

    def kept() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in shared_path.rglob("*") if path.is_file()}

    short = Case.parse(CASE | {"path": CASE["path"] | {"max_events": 2}})
    with pytest.raises(ConvergenceError, match="max_events"):
        run(short, comm, out=shared_path)
    for damage in ("", DAMAGED):
        on_root(comm, lambda text=damage: text and (shared_path / result_json.NAME).write_text(text))
        before = on_root(comm, kept)
        with pytest.raises(CaseError) as error:
            run(Case.parse(CASE | {"name": "other"}), comm, out=shared_path)
        way = f"--resume goes on from them; remove {shared_path / 'checkpoint'} to start again"
        place = f"--out {shared_path}: it holds 2 events of this path"
        parallel_assert(comm, error.value.faults == (f"{place}: {way}",), str(error.value))
        parallel_assert(comm, on_root(comm, kept) == before)
    on_root(comm, checkpoints.remove, shared_path)
    assert run(Case.parse(CASE), comm, out=shared_path).resumed == 0


OTHER = CASE | {"name": "stiffer", "interface": {"normal_strength": 4.1, "tangential_strength": 3.0}}
LEFT = {
    "nothing": (None, ""),
    "its own": (CASE | {"name": "renamed"}, ""),
    "another": (OTHER, 'replaces the result of case "stiffer" (20'),
    "another, begun": (OTHER, ", unfinished, 6 points up to load 0."),
    "another, damaged": (OTHER, "replaces a result that cannot be read: "),
}


@pytest.mark.parametrize("kind", LEFT)
def test_a_run_names_the_other_case_that_it_replaces(comm, shared_path, kind, capsys):
    case, expected = LEFT[kind]
    if kind.endswith("begun"):
        with interrupted(), pytest.raises(RuntimeError, match="interrupted"):
            run(Case.parse(case), comm, out=shared_path)
    elif case:
        run(Case.parse(case), comm, out=shared_path)
    if kind.endswith("damaged"):
        on_root(comm, (shared_path / result_json.NAME).write_text, DAMAGED)
    comm.barrier()
    capsys.readouterr()
    run(Case.parse(CASE), comm, out=shared_path, quiet=False)
    lines = [line for line in capsys.readouterr().out.splitlines() if "replaces" in line]
    named = [f"warning: {shared_path}: this run "] * bool(expected and comm.rank == 0)
    parallel_assert(comm, len(lines) == len(named), str(lines))
    parallel_assert(comm, all(named[0] in line and expected in line for line in lines))


def test_cards_and_certificates_name_the_points_of_an_unfinished_path(comm, shared_path):
    begun(comm, shared_path, CASE["path"])

    def refused() -> None:
        place, way = output_folder.latest(shared_path)["unfinished"], f"feti-homog run CASE --out {shared_path}"
        with pytest.raises(CaseError) as error:
            export.card(shared_path, "abaqus", "orthotropic")
        assert error.value.faults == (f"{shared_path}: the run is {place}; go on by `{way} --resume`",)
        with file_locks.Lock(shared_path / output_folder.LOCK), pytest.raises(CaseError, match=rf"{place}; .* goes on"):
            output_folder.refuse_begun(shared_path)
        (shared_path / checkpoints.FOLDER / checkpoints.NAME).write_bytes(b"")
        with pytest.raises(CaseError, match=rf"the run is unfinished, without a point; go on by `{way}`$"):
            output_folder.refuse_begun(shared_path)
        (shared_path / result_json.NAME).write_text("{}")
        output_folder.refuse_begun(shared_path)
        output_folder.refuse_begun(shared_path / "none")

    on_root(comm, refused)


def test_a_result_that_has_all_points_is_no_unfinished_path(comm, shared_path):
    """A path cut off by `max_events` keeps its checkpoint, and its error the points; later events are newer."""
    short = Case.parse(CASE | {"path": CASE["path"] | {"max_events": 4}})
    for out, way in ((None, "a higher max_events"), (shared_path, "--resume with a higher max_events")):
        with pytest.raises(ConvergenceError, match=f"max_events = 4: .*; {way} goes on") as error:
            run(short, comm, out=out)
        assert len(error.value.result.path) == 4 and error.value.result.faults == error.value.faults
    assert on_root(comm, output_folder.latest, shared_path)["status"] == "not converged"
    with interrupted(), pytest.raises(RuntimeError, match="interrupted"):
        run(Case.parse(CASE), comm, out=shared_path, resume=True)
    assert len(on_root(comm, output_folder.latest, shared_path)["path"]) == EVENTS


def test_a_sweep_on_other_ranks_leaves_the_events_of_a_begun_case(comm, shared_path):
    """One line, no failure that --retry would compute again; on as many ranks as before, the path goes on."""
    if comm.size == 1:
        pytest.skip("one rank is alone")
    document = CASE | {"output": {"fields": False}, "sweep": {"interface.normal_strength": [4.0, 4.5, 5.0]}}
    out = shared_path / "out"
    with interrupted(of="case-0002"), pytest.raises(RuntimeError, match="interrupted"):
        run_sweep(document, out, comm)
    comm.barrier()

    def refused() -> None:
        for retry in (False, True):
            with pytest.raises(CaseError, match="events of a run on 2 ranks; go on with as many"):
                run_sweep(document, out, MPI.COMM_SELF, retry=retry)
            _, begun, last = case_runs.list_cases(sweep_cases.expand(document, Path()), out)[:3]
            assert begun.startswith("case-0002  interrupted") and last.startswith("case-0003  done")

    on_root(comm, refused)
    run_sweep(document, out, comm)
    assert on_root(comm, result_json.read, out / "case-0002")["resumed"] == EVENTS


@pytest.mark.one_rank
def test_sweeps_tell_and_collect_begun_cases(comm, shared_path):
    """The second of two points is interrupted: the first alone has statistics."""
    document = CASE | {"output": {"fields": False}, "sweep": {"interface.normal_strength": [4.0, 4.5]}}
    out, sweep = shared_path / "out", sweep_cases.expand(document, Path())
    with interrupted(of="case-0002"), pytest.raises(RuntimeError, match="interrupted"):
        run_sweep(document, out, comm)
    comm.barrier()

    def told() -> None:
        first, second = case_runs.list_cases(sweep, out)
        assert first.startswith("case-0001  done         ") and second.startswith("case-0002  interrupted  ")
        so_far = output_folder.latest(out / "case-0002")
        assert second.endswith(f"normal_strength = 4.5; {so_far['unfinished']}") and "; " not in first
        lines = collect.collect(out, pictures=False)
        assert lines[:2] == ["2 cases: 1 done, 1 interrupted", f"  case-0002  interrupted; {so_far['unfinished']}"]
        rows = list(csv.DictReader((out / "cases.csv").read_text().splitlines()))
        stress = [point["stress"][0] for point in so_far["path"]]
        assert [row["status"] for row in rows] == ["done", "interrupted"] and rows[1]["reason"] == so_far["unfinished"]
        assert float(rows[1]["end_S11"]) == stress[-1] and float(rows[1]["peak_S22"]) > 0.0
        means = csv.DictReader((out / "statistics.csv").read_text().splitlines())
        assert {row["point"] for row in means} == {"1"}
        with file_locks.Lock(out / "case-0002" / case_folders.LOCK_FILE):
            assert case_runs.list_cases(sweep, out)[1].startswith("case-0002  running  ")

    on_root(comm, told)
    table = run_sweep(document, out, comm)
    parallel_assert(comm, list(table.status) == ["done", "done"])


@pytest.mark.one_rank
def test_a_sweep_shows_the_load_of_the_path_that_it_computes(comm, shared_path, monkeypatch):
    calls, shown = list[tuple[Any, ...]](), stepped_progress.shown

    @contextmanager
    def seen(progress: Any, label: str) -> Iterator[Any]:
        with shown(progress, label) as advance:
            yield lambda *words: (calls.append((label, *words)), advance(*words))

    monkeypatch.setattr(stepped_progress, "shown", seen)
    document = CASE | {"output": {"fields": False}, "sweep": {"interface.normal_strength": [4.0, 4.5]}}
    run_sweep(document, shared_path, comm)
    loads = on_root(comm, lambda: [[p["load_factor"] for p in result_json.read(shared_path / f"case-000{k}")["path"]]
                                   for k in (1, 2)])  # fmt: skip
    expected = [(k + load) / 2 for k in (0, 1) for load in (*loads[k], 1.0)]
    of_all = [words for label, *words in calls if label == f"cases of {shared_path.name}"][: len(expected)]
    parallel_assert(comm, [share for share, *_ in of_all] == expected and len(expected) > 2 * EVENTS)
    assert of_all[0][2].startswith("case 1 of 2: load ") and of_all[len(loads[0])][2] == "1 of 2 cases"
