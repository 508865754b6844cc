"""Fields of some points of a path: those of a run that keeps all, also after an interruption and an early end."""

import json
from pathlib import Path
from typing import Any
from unittest import mock

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from support.ranks import PIECES, assert_certified, parallel_assert

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.materials.voigt import STRAINS, STRESSES
from feti_homog.results import checkpoints, field_file
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

EXACT = 1e-12
PATHS: dict[str, dict[str, Any]] = {
    "straight": {"strain": [0.2, 0.0, 0.05]},
    "legs": {"waypoints": [[0.1, 0.0, 0.0], [-0.05, 0.02, 0.0], [0.1, 0.0, 0.1]]},
    "increments": {"waypoints": [[0.1, 0.0, 0.0], [-0.05, 0.02, 0.0]], "method": "increments", "increments": 12},
    "energy": {"waypoints": [[0.1, 0.0, 0.0], [-0.05, 0.02, 0.0]]},
}
STRENGTHS = {"normal_strength": 4.0, "tangential_strength": 3.0}
ENERGY = {"normal_stiffness": 2000.0, "tangential_stiffness": 500.0, "criterion": "energy", "toughness": 0.01}
# With history, unconfirmed events, and slip along the fibres.
SOFTENING = {
    "law": "bilinear",
    "normal_stiffness": 4000.0,
    "tangential_stiffness": 3000.0,
    "normal_toughness": 0.01,
    "tangential_toughness": 0.02,
    "teeth": 3,
    **STRENGTHS,
}
OTHER_PATHS: dict[str, dict[str, Any]] = {
    "softening": {
        "interface": SOFTENING,
        "path": {"waypoints": [{"E11": 0.08, "S22": 0.0, "S12": 0.0}, {"E11": -0.02, "S22": 0.0, "S12": 0.0}]},
        "petsc": {"feti_pc_type": "influence"},
    },
    "released": {
        "interface": ENERGY | {"growth": "released"},
        "path": {"waypoints": [{"E11": 0.1, "S13": 3.0}, {"E11": -0.05, "S13": 1.0}]},
        "analysis": {"type": "path", "plane": "generalized"},
        "petsc": {"feti_pc_type": "influence"},
    },
}
SOLVED_AGAIN = 1e-7  # what a solve to the default tolerance leaves
# Some paths with a number of states, one with those of its peaks.
STATES = [("legs", 5), ("increments", 2), ("energy", 5), ("legs", "peaks")]


def case(kind: str, states: int | str, **path: Any) -> Case:
    written = {
        "name": kind,
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
        "material": {"matrix": {"young": 100.0, "poisson": 0.4}, "fibre": {"young": 500.0, "poisson": 0.2}},
        "analysis": {"type": "path", "plane": "stress"},
        "interface": ENERGY if kind == "energy" else STRENGTHS,
        "path": PATHS.get(kind, {}),
        "decomposition": PIECES,
        "output": {"pictures": False, "states": states},
    }
    written |= OTHER_PATHS.get(kind, {})
    return Case.parse(written | {"path": written["path"] | path})


def states_of(folder: Path) -> list[dict[str, Any]]:
    """Tables and attributes of each state of a result.h5."""
    with h5py.File(folder / field_file.NAME, "r") as file:
        groups = [file[f"state/{k}"] for k in range(len(file["state"]))]
        return [
            {name: table[()] for name, table in group.items()} | {f"@{name}": v for name, v in group.attrs.items()}
            for group in groups
        ]


OF_KEPT = {"tips", "mesh_error", "debonded_length", "debonding_angle"}


def document(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return content


def assert_kept_of(folder: Path, whole: Path, exact: float = EXACT) -> None:
    """On one rank: the states of a folder are the same points' of a run that kept all, and so is the curve.

    A field is measured by its largest value on the whole path: the jumps of a point where all is bonded are rounding.
    """
    some, every, numbers = states_of(folder), states_of(whole), document(folder)["states"]
    assert document(whole)["states"] == list(range(len(every))) == [state["@point"] for state in every]
    assert [state["@point"] for state in some] == numbers
    for state in some:
        expected = every[state["@point"]]
        assert state.keys() == expected.keys()
        for name, values in state.items():
            if name in ("@label", "status"):
                assert np.array_equal(values, expected[name]), name
            else:
                scale = max(np.nanmax(np.abs(each[name]), initial=0.0) for each in every if name in each)
                np.testing.assert_allclose(values, expected[name], rtol=0, atol=exact * scale, err_msg=name)
    curves = [document(each)["path"] for each in (folder, whole)]
    for number, (point, expected) in enumerate(zip(*curves, strict=True)):
        assert point.keys() - OF_KEPT == expected.keys() - OF_KEPT
        assert all((name in point) == (name in expected and number in numbers) for name in OF_KEPT)
        tips = [(point["tips"][name], values) for name, values in expected["tips"].items()] if "tips" in point else []
        assert point.get("mark") == expected.get("mark")
        numbers_of = point.keys() - {"tips", "iterations", "mark"}
        for value, wanted in [*tips, *((point[name], expected[name]) for name in numbers_of)]:
            # After an interruption influence columns are found in another order, which changes rounding.
            assert value == pytest.approx(wanted, rel=1e-9, abs=exact)
    lines = (folder / "events.log").read_text().splitlines()[1:]
    log = [line for line in lines if ", along the fibres:" not in line]
    for line, point in zip(log, curves[0], strict=True):
        strain, stress = (np.take(point[name], [0, 1, -1]) for name in ("strain", "stress"))  # of the plane
        k = int(np.abs(strain).argmax())
        reached = f"{STRAINS[k]} {strain[k]:.4g}, {STRESSES[k]} {stress[k]:.4g}"
        assert f", {reached}" in line


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """kind -> folder of a run that keeps the fields of all points."""
    folders: dict[str, Path] = {}

    def folder(kind: str) -> Path:
        if kind not in folders:
            folders[kind] = Path(MPI.COMM_WORLD.bcast(str(tmp_path_factory.mktemp(kind)))) / "all"
            run(case(kind, "all"), MPI.COMM_WORLD, out=folders[kind])
        return folders[kind]

    return folder


@pytest.mark.parametrize(("kind", "states"), STATES)
def test_kept_states_are_those_of_a_run_that_keeps_all(comm, shared_path, whole, kind, states):
    result = run(case(kind, states), comm, out=shared_path)
    assert len(result.states) == states if states != "peaks" else 2 <= len(result.states) < len(result.path)
    expected = whole(kind)
    on_root(comm, assert_kept_of, shared_path, expected)
    assert_certified(comm, shared_path)


def test_an_interrupted_path_keeps_the_same_states(comm, shared_path, whole):
    """Ended by max_events twice; each time the fields of what there is are written."""
    for events, resume in ((6, False), (9, True)):
        with pytest.raises(ConvergenceError, match="max_events"):
            run(case("energy", 4, max_events=events), comm, out=shared_path, resume=resume)
        assert document(shared_path)["states"][-1] == events - 1 == states_of(shared_path)[-1]["@point"]
        assert len(states_of(shared_path)) == 4
        comm.barrier()
    result = run(case("energy", 5), comm, out=shared_path, resume=True)
    assert result.resumed == 9
    expected = whole("energy")
    on_root(comm, assert_kept_of, shared_path, expected)


@pytest.mark.parametrize(("kind", "room"), [("softening", 20_000), ("released", 0)])
def test_states_without_multipliers_are_solved_again(comm, shared_path, whole, kind, room):
    """There is room for the multipliers of no event, or of the first ones; the path is ended and goes on, too."""
    known, expected = len(document(whole(kind))["path"]) * 2 // 3, whole(kind)
    with mock.patch.object(checkpoints, "room_of", return_value=room):
        with pytest.raises(ConvergenceError, match="max_events"):
            run(case(kind, 5, max_events=known), comm, out=shared_path, resume=False)
        found = on_root(comm, multipliers_of, shared_path / "checkpoint/events")
        parallel_assert(comm, not found[-1] and len(found) == known and any(found) == (room > 0))
        with pytest.raises(ConvergenceError, match="max_events"):  # fewer than there are
            run(case(kind, 5, max_events=known - 2), comm, out=shared_path, resume=True)
        parallel_assert(comm, len(document(shared_path)["path"]) == known - 2)
        result = run(case(kind, 5), comm, out=shared_path, resume=True)
        in_memory = run(case(kind, 5), comm, fields=True)
    assert result.resumed == known and in_memory.states == result.states
    on_root(comm, assert_kept_of, shared_path, expected, SOLVED_AGAIN)
    assert_certified(comm, shared_path)
    fields = in_memory.fields.gathered()
    if comm.rank == 0:
        for state, other in zip(fields.states, states_of(shared_path), strict=True):
            scale = np.abs(other["stress"]).max()
            np.testing.assert_allclose(state.stress, other["stress"], rtol=0, atol=SOLVED_AGAIN * scale)


def multipliers_of(path: Path) -> list[bool]:
    """Return which events of a file have multipliers."""
    contents = [content for _, content in checkpoints.records(path)]
    return ["lam" in checkpoints.unpacked(content) for content in contents[1:]]


def test_states_in_memory_are_those_of_the_files(comm, whole):
    result = run(case("legs", 4), comm, fields=True)
    gathered = result.fields.gathered()
    expected = whole("legs")
    if comm.rank == 0:
        every = states_of(expected)
        assert [state.point for state in gathered.states] == list(result.states) and len(result.states) == 4
        for state in gathered.states:
            np.testing.assert_allclose(state.stress, every[state.point]["stress"], rtol=1e-12, atol=1e-12)
            np.testing.assert_array_equal(state.status, every[state.point]["status"])
    assert run(case("legs", 4), comm).states is None


def test_a_point_that_does_not_converge_is_kept(comm, shared_path):
    unsolvable = case("straight", 3)
    unsolvable.petsc.update({"feti_ksp_max_it": 4, "feti_pc_type": "none", "feti_ksp_rtol": 1e-12})
    with pytest.raises(ConvergenceError):
        run(unsolvable, comm, out=shared_path)
    found = document(shared_path)
    assert found["status"] == "not converged" and found["states"][-1] == len(found["path"]) - 1
    assert len(states_of(shared_path)) == len(found["states"])
    comm.barrier()


def test_without_fields_none_are_kept(comm, shared_path):
    without = case("straight", 3)
    document_of = without.resolved()
    document_of["output"]["fields"] = False
    result = run(Case.parse(document_of), comm, out=shared_path)
    assert result.states is None and "states" not in document(shared_path)
    parallel_assert(comm, not (shared_path / field_file.NAME).exists())


def test_damage_starts_at_the_poles_of_a_pulled_fibre(comm: Any) -> None:
    """There the normal traction is largest; softening starts before the first break, and steps break many bonds."""
    strain = [0.0, 0.2, 0.0]
    softening = Case.parse(case("softening", 2).resolved() | {"path": {"strain": strain}})
    stepped = {"path": {"strain": strain, "method": "increments", "increments": 3}}
    steps = Case.parse(case("straight", 2).resolved() | stepped)
    for pulled in (case("straight", 2, strain=strain), softening, steps):
        peak = run(pulled, comm).peak
        assert peak is not None
        bonds = [(peak.first_break_fibre, peak.first_break_angle)]
        if pulled is softening:
            bonds.append((peak.first_softening_fibre, peak.first_softening_angle))
            parallel_assert(comm, (peak.first_softening_event or 0) < (peak.first_break_event or 0))
        for fibre, direction in bonds:
            off = abs(float(direction or 0.0) - 90.0) % 180.0
            parallel_assert(comm, fibre == 1 and min(off, 180.0 - off) < 25.0)
