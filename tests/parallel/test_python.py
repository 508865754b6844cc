"""`from feti_homog import Case, run` in a program of its own: arrays, no files, and communicators of any size."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import convergence
import h5py
import numpy as np
import pytest
from mpi4py import MPI
from reference.references import BONDED
from support.cases import MATRIX, make_case
from support.jobs import mpirun
from support.ranks import parallel_assert

from feti_homog import Case, CaseError, ConvergenceError, FetiHomogError, api, collect_sweep, run, run_sweep
from feti_homog.results.field_layout import tables
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


def with_fraction(fraction, **rest):
    return make_case(fibre_fraction=fraction, mesh_size=0.25, **rest)


def test_run_gives_the_same_arrays_on_every_rank_and_writes_no_file(comm, shared_path, monkeypatch):
    """Compare the arrays of all ranks and look for files."""
    monkeypatch.chdir(shared_path)
    result = run(with_fraction(0.4, order=2), comm)
    L = result.effective_stiffness
    assert L.shape == (3, 3) and result.effective_stiffness_compression is None and not result.points
    parallel_assert(comm, all(np.array_equal(L, other) for other in comm.allgather(L)))
    assert L[[0, 0, 2], [0, 1, 2]] == pytest.approx(BONDED["hexagonal", "strain"].value, rel=1e-3)
    assert result.bounds.reuss[0, 0] < L[0, 0] < result.bounds.voigt[0, 0]
    assert result.moduli.shear == pytest.approx(L[2, 2], rel=1e-3) and max(result.document["checks"].values()) < 1e-7
    assert result.document["solver"]["ranks"] == result.solver.ranks == comm.size
    comm.barrier()
    parallel_assert(comm, not list(shared_path.iterdir()))


@pytest.mark.one_rank
def test_what_polygons_lose_is_remarked(comm):
    """A circle of n edges has lost 1 - sin(2 pi / n) / (2 pi / n) of its area."""
    (remark,) = run(with_fraction(0.4, order=1), comm).remarks
    assert remark == "[cell] order = 1: polygons have 2.6% less area than the fibres asked for; refine, or order = 2"
    assert run(with_fraction(0.4, order=1, refine=3), comm).remarks == ()
    assert run(with_fraction(0.4, order=2), comm).remarks == ()


def test_fields(comm, shared_path):
    """In memory what result.h5 holds: each rank its part, gathered all of it in the file's order."""
    result = run(with_fraction(0.4, geometry="square"), comm, out=shared_path / "out", fields=True)
    fields = result.fields
    assert [state.label for state in fields.states] == ["E11", "E22", "gamma12"]
    assert len(fields.mesh.points) == len(fields.states[0].displacement)
    assert all(len(repr(each)) < 100 for each in (result, fields, fields.states[0]))
    parallel_assert(comm, comm.allreduce(len(fields.mesh.triangles)) == result.cell.elements)
    whole = fields.gathered()
    assert (whole is None) == (comm.rank > 0)
    same = True
    if whole is not None:
        parts = {"mesh": whole.mesh, "fibre": whole.fibres, "interface": whole.interface, "state/2": whole.states[2]}
        with h5py.File(shared_path / "out" / "result.h5", "r") as file:
            same = all(
                np.array_equal(file[f"{group}/{name}"][()], getattr(part, name))
                for group, part in parts.items()
                for name in tables(part)
            )
    parallel_assert(comm, same)
    assert run(with_fraction(0.4), comm).fields is None


def test_with_files(comm, shared_path):
    """The result that is returned is the one that is written; a path goes on, and a finished one is read again."""
    document = with_fraction(0.4, geometry="square").resolved()
    document |= {"interface": {"normal_strength": 5.0}, "path": {"strain": [0.2, 0.0, 0.0]}}
    document |= {"output": {"fields": False, "pictures": False}, "analysis": {"type": "path", "plane": "stress"}}
    case = Case.parse(document)
    message = r'^\[path\] max_events = 1: .* status "not converged"; --resume with a higher max_events goes on$'
    with pytest.raises(ConvergenceError, match=message):
        run(case.replace({"path.max_events": 1}), comm, out=shared_path / "out")
    if comm.rank == 0:
        for name in ("result.h5", "load.csv", "case_E11.png", "mine.png"):
            (shared_path / "out" / name).touch()
    comm.barrier()
    result = run(case, comm, out=shared_path / "out", resume=True)
    assert result.status == "done" and result.resumed == 1 and result.path[-1].load_factor == 1.0
    assert result.points["strain"].shape == result.points["stress"].shape == (len(result.path), 3)
    comm.barrier()
    written = sorted(p.name for p in (shared_path / "out").iterdir())
    parallel_assert(comm, written == ["events.log", "mine.png", "path.csv", "result.json"], str(written))
    again = run(case, comm, out=shared_path / "out", resume=True)
    assert [p.load_factor for p in again.path] == [p.load_factor for p in result.path]
    assert np.array_equal(again.points["stress"], result.points["stress"]) and again.checks == result.checks
    assert again.timings == result.timings and again.solver == result.solver and again.case == result.case
    rising, load = result.rising_strain(), result.path[0].load_factor
    after = next(point for point in result.path[1:] if point.load_factor >= load)
    names = list(rising)
    assert names == ["E11", "S11", "S22", "S12"]
    assert [rising[name][2] for name in names[1:]] == pytest.approx(after.stress * load / after.load_factor)
    assert [rising[name][1] for name in names[1:]] == pytest.approx(result.path[0].stress)
    with pytest.raises(ValueError, match="path of one leg"):
        run(with_fraction(0.4), comm).rising_strain()


def test_a_finished_run_is_no_answer_to_a_case_that_asks_for_more(comm, shared_path):
    """Sensitivities that the first run did not compute are not passed over."""
    document = with_fraction(0.4, geometry="square").resolved() | {"output": {"fields": False, "pictures": False}}
    run(Case.parse(document), comm, out=shared_path / "out")
    document["output"] |= {"length_unit": "mm"}
    assert run(Case.parse(document), comm, out=shared_path / "out", resume=True).sensitivities is None
    document["output"] |= {"sensitivities": True}
    with pytest.raises(
        CaseError, match=r"holds the result of another case, which differs in output.sensitivities: false now true; c"
    ):
        run(Case.parse(document), comm, out=shared_path / "out", resume=True)


def test_not_quiet_prints_what_the_command_line_prints(comm, capsys):
    case = with_fraction(0.4, geometry="square")
    run(case, comm)
    silent = capsys.readouterr().out
    result = run(case, comm, quiet=False)
    printed = capsys.readouterr().out
    stages = all(f"\n{stage} " in f"\n{printed}" for stage in ("mesh", "factor", "solve"))
    whole = stages and printed.strip().endswith("done") and f"{result.effective_stiffness[0, 0]:.4f}"[:5] in printed
    parallel_assert(comm, not silent and (whole if comm.rank == 0 else not printed), printed)


@pytest.mark.one_rank
@pytest.mark.parametrize("growth", ["released", "springs"])
def test_a_path_scales_with_the_root_of_its_toughness(comm, growth):
    """Two legs with contact, against a run with that toughness and loads that are as many times larger."""
    bonds = {"criterion": "energy", "growth": growth, "normal_stiffness": 100.0, "tangential_stiffness": 40.0}
    document = with_fraction(0.4, geometry="square").resolved()
    document |= {"analysis": {"type": "path", "plane": "stress"}, "petsc": {"feti_ksp_rtol": 1e-12}}
    s, G_c, loads = 1.7, 0.001, [{"E11": 0.02, "S22": 0.0}, {"E11": -0.01, "S22": 0.3}]
    result, expected = (
        run(Case.parse(document | {"interface": bonds | {"toughness": G}, "path": {"waypoints": waypoints}}), comm)
        for G, waypoints in ((G_c, loads), (G_c * s**2, [{k: s * v for k, v in load.items()} for load in loads]))
    )
    assert len(result.path) > 5 and result.peak.event_left is not None
    powers = {"load_factor": 0, "strain": 1, "stress": 1, "broke": 0, "open": 0}
    powers |= dict.fromkeys(("stored", "work", "dissipated", "fracture_energy"), 2)
    for name, power in powers.items():
        known = expected.points[name]
        assert s**power * result.points[name] == pytest.approx(known, rel=1e-9, abs=1e-9 * np.abs(known).max())


@pytest.mark.parametrize("case", ["case.toml", {"cell": {}}, 3])
def test_what_is_no_case_is_refused(comm, case):
    with pytest.raises(TypeError, match=r"run takes a Case, not .*Case.load .*Case.parse"):
        run(case, comm)


def test_ranks_with_different_cases_are_refused(comm, shared_path):
    """Each rank would solve a part of its own case, without an error; alone, each rank may run it."""
    case, out = with_fraction(0.3 + 0.1 * comm.rank), shared_path / str(comm.rank)
    values = {"matrix": MATRIX | {"young": 1.0 + comm.rank}, "petsc": {"feti_ksp_max_it": 1000 + comm.rank}}
    cases = [case, *(with_fraction(0.3, **{name: value}) for name, value in values.items())]
    sweep = {k: v for k, v in case.resolved().items() if v != {}} | {"sweep": {"material.fibre.young": [1.0, 2.0]}}
    calls = [lambda case=case: run(case, comm) for case in (*cases, None if comm.rank else case)]
    calls += [lambda: run(cases[0].replace({"cell.fibre_fraction": 0.3}), comm, out=out)]
    calls += [lambda: run_sweep(sweep, shared_path / "sweep", comm), lambda: collect_sweep(out, comm)]
    for call in calls if comm.size > 1 else ():
        with pytest.raises(CaseError, match=r"ranks have different cases or arguments; comm = MPI.COMM_SELF runs"):
            call()
    comm.barrier()
    parallel_assert(comm, not list(shared_path.iterdir()))
    fraction = run(case, MPI.COMM_SELF).cell.fibre_fraction
    assert fraction == pytest.approx(0.3 + 0.1 * comm.rank, rel=0.03)


def test_a_second_thread_is_refused(comm):
    """Two threads in PETSc would crash it."""
    with api._started(comm), ThreadPoolExecutor(1) as other:
        refused = other.submit(run, with_fraction(0.4), comm).exception()
        assert isinstance(refused, FetiHomogError) and "another thread" in str(refused)
        assert run(with_fraction(0.4), comm).status == "done"


def test_faulty_sweeps_are_refused(comm, shared_path):
    document = {k: v for k, v in with_fraction(0.4).resolved().items() if v != {}}
    with pytest.raises(CaseError, match=r"^\[sweep\]: missing section"):
        run_sweep(document, shared_path / "out", comm)
    document |= {"sweep": {"cell.fibre_fraction": [0.3, 0.4]}}
    for ranks in (0, comm.size + 1):
        with pytest.raises(CaseError, match=f"{ranks}: expected a divisor of the {comm.size} ranks"):
            run_sweep(document, shared_path / "out", comm, ranks_per_case=ranks)
    parallel_assert(comm, not (shared_path / "out").exists())


def test_a_sweep(comm, shared_path):
    document = {k: v for k, v in with_fraction(0.4).resolved().items() if v != {}}
    document |= {"output": {"fields": False, "pictures": False}, "sweep": {"cell.fibre_fraction": [0.3, 0.4]}}
    table = run_sweep(document, shared_path / "out", comm, ranks_per_case=1)
    assert table.status == ["done", "done"] and table.outputs["C11"][0] < table.outputs["C11"][1]
    words = collect_sweep(shared_path / "out", comm, pictures=False)
    tables = [str(shared_path / "out" / name) for name in ("cases.csv", "statistics.csv")]
    assert words[0] == "2 cases: 2 done" and words[-2:] == tables and any("E1" in line for line in words)


def test_halves_of_the_ranks_run_cases_of_their_own(comm):
    """Each half of the ranks runs cases of its own; every rank alone finds the same."""
    colour = comm.rank % 2
    group = comm.Split(colour)
    for fraction in (0.3, 0.4):
        case = with_fraction(fraction + 0.05 * colour)
        together, alone = run(case, group), run(case, MPI.COMM_SELF)
        assert together.document["solver"]["ranks"] == group.size
        assert together.effective_stiffness == pytest.approx(alone.effective_stiffness, rel=1e-8, abs=1e-6)
    group.Free()


def test_many_runs_one_after_the_other_leave_nothing_behind(comm):
    """Many runs one after the other, as an optimiser does, leave nothing behind that fails the next."""
    found = [
        run(make_case(matrix=MATRIX | {"young": young}, mesh_size=0.3), comm).effective_stiffness[2, 2]
        for young in np.linspace(60.0, 90.0, 12)
    ]
    assert (np.diff(found) > 0).all()


def test_faults_and_failures_are_raised_and_the_next_run_works(comm):
    with pytest.raises(CaseError, match="fibre_fraction"):
        Case.parse({"cell": {"geometry": "square", "fibre_fraction": 0.9}})
    with pytest.raises(ConvergenceError, match="no convergence after 2 iterations"):
        run(with_fraction(0.4, petsc={"feti_ksp_max_it": 2}, decomposition={"cut": "bodies"}), comm)
    assert run(with_fraction(0.4), comm).document["checks"]


def test_the_largest_traction_of_a_driver_is_that_of_one_rank(comm, shared_path):
    given, cell = SimpleNamespace(fields=True, pictures=False), make_case(mesh_size=0.25).resolved()["cell"]
    found = convergence.traction(given, comm, cell, shared_path / "all")
    expected = on_root(comm, lambda: convergence.traction(given, MPI.COMM_SELF, cell, shared_path / "one"))
    assert found == pytest.approx(expected, rel=1e-6)


ALONE = """
import sys
from mpi4py import MPI
from feti_homog import Case, run
assert "petsc4py" not in sys.modules
comm = MPI.COMM_WORLD
case = Case.load({path!r})
if comm.rank == 0:
    print(run(case, MPI.COMM_SELF).effective_stiffness[0, 0])
"""


def test_a_run_on_one_rank_does_not_wait_for_the_others(comm, shared_path):
    """PETSc, started by the first run, does not wait for them; here in a program of its own."""
    if comm.rank == 0:
        import tomli_w

        path = shared_path / "case.toml"
        path.write_text(tomli_w.dumps({k: v for k, v in with_fraction(0.4).resolved().items() if v != {}}))
        job = mpirun(2, "-c", ALONE.format(path=str(path)))
        expected = BONDED["hexagonal", "strain"].value[0]
        found = job.returncode == 0 and float(job.stdout) == pytest.approx(expected, rel=0.02)
    else:
        found = True
    parallel_assert(comm, found)
