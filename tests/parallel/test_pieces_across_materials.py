"""Cells cut across their materials against the monolithic solve, and against whole runs of the same cells by bodies."""

import json

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree
from support.cases import FIBRE, MATRIX, make_case, monolithic_stiffness, relative_error, solve
from support.label_images import RUN, circles_in_pixels
from support.pixel_images import pixel_mesh

from feti_homog import Case, run
from feti_homog.feti.operators.one_subdomain import Interior
from feti_homog.homogenization.averaging import Homogenization
from feti_homog.homogenization.partition_policy import BY_COST, PartitionPolicy
from feti_homog.homogenization.uniform_parts import nodes_of_parts
from feti_homog.homogenization.unit_cell import tear
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.system.petsc.option_table import OPTIONS, only_prints
from feti_homog.system.runtime.records import plain
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.parallel
RANDOM = {
    "geometry": "random", "fibres": 4, "fibre_fraction": 0.4, "min_gap": 0.1, "mesh_size": 0.1,
    "output": {"fields": False},
}  # fmt: skip
CARBON = {"E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25, "G_axial": 28.0}
CELLS = {
    "linear": {"refine": 1},
    "quadratic": {"order": 2},
    "carbon": {"order": 2, "fibre": CARBON},
    "voids": {"voids": 0.1, "fibre_fraction": 0.2},
    "stiff": {"matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": 900.0, "poisson": 0.2}},
}
SOFT = {"young": 20.0, "poisson": 0.3}
POLICIES = {
    "whole": PartitionPolicy(across_dofs=10**9, whole_dofs=10**9),
    "pieces": PartitionPolicy(across_dofs=10**9, whole_dofs=0, across_piece_dofs=400),
}


@pytest.mark.parametrize(("cell", "policy"), [("linear", "whole"), *((cell, "pieces") for cell in CELLS)])
def test_stiffness_is_the_monolithic_one(comm, cell, policy):
    policy = POLICIES[policy]
    torn, L, responses = solve(make_case(**RANDOM | CELLS[cell]), comm, policy=policy)
    assert torn.summary.across and (torn.summary.subdomains == comm.size or not policy.whole_dofs)
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-8
    assert max(max(r.checks.values()) for r in responses) < 1e-7
    assert all(r.state.iterations < 40 for r in responses)
    assert sum(map(nodes_of_parts, torn.subdomains)) == sum(len(part.mesh.points) for part in torn.parts)


def test_label_images_with_voids_are_cut_in_blocks(comm, shared_path):
    image = circles_in_pixels(40)
    image[18:21, 3:30] = 2
    if comm.rank == 0:
        np.save(shared_path / "image.npy", image)
    comm.barrier()
    labels = {"0": "matrix", "1": "fibre", "2": "void"}
    document = {"geometry": "pixels", "file": str(shared_path / "image.npy"), "labels": labels, "pixel": 0.1}
    policy = PartitionPolicy(across_dofs=1, whole_dofs=0, across_piece_dofs=400)
    torn, L, responses = solve(Case.parse(RUN | {"cell": document}), comm, policy=policy)
    assert torn.summary.across and 9 <= torn.summary.subdomains <= 12
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-8
    assert all(r.state.iterations < 40 for r in responses)


@pytest.mark.parametrize("fault", ["strain", "hill"])
def test_checks_of_one_subdomain_can_fail(fault, monkeypatch):
    rng, solve_exactly = np.random.default_rng(0), Interior.solve
    if fault == "hill":
        monkeypatch.setattr(Interior, "solve", lambda s, f: solve_exactly(s, f * (1 + 1e-4 * rng.random(f.shape))))
    torn, _, _ = solve(make_case(**RANDOM), MPI.COMM_SELF, policy=POLICIES["whole"])
    if fault == "strain":
        torn.subdomains[0].slopes[3] += 1e-4
    averages = Homogenization(torn, contact=False)
    checks = averages.respond(np.eye(3)[:1], averages.intact, [np.zeros(0)])[0].checks
    assert {law for law, error in checks.items() if not error < 1e-6} == {fault}
    assert "jump" not in checks  # nothing is glued


PRINTING = (
    *(option.name for option in OPTIONS if only_prints(option.name)),
    *(f"feti_ksp_{name}" for name in ("monitor_true_residual", "view_eigenvalues", "converged_rate", "view_mat")),
    *("feti_bonded_ksp_view", "feti_schur_ksp_view", "feti_sub_ksp_converged_reason", "feti_natural_ksp_monitor"),
)


@pytest.mark.parametrize("cut", ["auto", "bodies"])
def test_options_that_print_change_no_number(comm, capfd, cut):
    """Neither where a cell is not cut, or halved, without iterations, nor where iterations are to be seen."""
    cell = {"geometry": "square", "mesh_size": 0.4, "output": {"fields": False}, "decomposition": {"cut": cut}}
    expected, _ = _outcome(comm, capfd, cell, {})
    for name in PRINTING:
        found, printed = _outcome(comm, capfd, cell, {name: True})
        assert found == expected, name
        if comm.rank == 0 and name.startswith("feti_ksp_") and cut == "auto":
            assert printed.count(f"remark: -{name}: the run has no iterations to print") == 1


def _outcome(comm, capfd, cell, petsc):
    """Return result.json without options, times and memory, and what the run prints."""
    found = plain(run(make_case(**cell, petsc=petsc), comm, quiet=False).document)
    del found["date"], found["timings"], found["memory"], found["case"]["petsc"]
    comm.barrier()
    return json.dumps(found, default=np.ndarray.tolist), capfd.readouterr().out


def document(cut):
    """Return a coated cell in generalized plane strain that asks for all that is summed up phase by phase."""
    expansion = {"expansion": 5e-5}
    return {
        "cell": {"geometry": "random", "fibres": 3, "fibre_fraction": 0.3, "mesh_size": 0.15, "coating": 0.2},
        "material": {"matrix": MATRIX | expansion, "fibre": FIBRE | expansion, "coating": SOFT | expansion},
        "analysis": {"type": "stiffness", "plane": "generalized"},
        "output": {"fields": False},
        "decomposition": {"cut": cut},
        "petsc": {"feti_ksp_rtol": 1e-12},
    }  # fmt: skip


def test_load_counts_the_bonds_that_it_counts_by_bodies(comm):
    load = {"analysis": {"type": "load", "plane": "generalized"}, "load": {"to": {"E11": 0.01}}}
    across, bodies = (run(Case.parse(document(cut) | load), comm) for cut in ("auto", "bodies"))
    assert across.solver.subdomains == comm.size
    counts = [(r.load.bonded, r.load.open, r.load.closed) for r in (across, bodies)]
    assert counts[0] == counts[1] and counts[0][0] > 0


def test_interface_nodes_are_those_by_bodies_if_one_is_pinned(comm, shared_path):
    on_root(comm, pixel_mesh(np.array([[0, 1], [1, 1]])).write, shared_path / "pixels.msh")
    cell = {"cell": {"geometry": "mesh", "file": str(shared_path / "pixels.msh"), "refine": 1}}
    pixels = document("auto") | cell | {"material": {"matrix": MATRIX, "fibre": FIBRE}}
    across, bodies = (run(Case.parse(pixels | {"decomposition": {"cut": cut}}), comm) for cut in ("auto", "bodies"))
    assert across.solver.subdomains == comm.size and bodies.solver.subdomains >= 2
    assert across.solver.interface_nodes == bodies.solver.interface_nodes > 0
    assert across.cell.nodes == bodies.cell.nodes or comm.size > 1


def test_porous_cells_of_one_phase_have_fields_and_no_interface(comm, shared_path):
    on_root(comm, pixel_mesh(np.diag([0, -1, 0, 0])).write, shared_path / "porous.msh")
    mesh = {"geometry": "mesh", "file": str(shared_path / "porous.msh"), "voids": True}
    cell = {"cell": mesh, "material": {"matrix": MATRIX}}
    runs = [Case.parse(document(cut) | cell) for cut in ("auto", "bodies")]
    across, bodies = (run(case, comm, fields=True) for case in runs)
    assert comm.allreduce(len(across.fields.interface.points)) == 0
    largest = [[comm.allreduce(np.abs(s.stress).max(), MPI.MAX) for s in r.fields.states] for r in (across, bodies)]
    np.testing.assert_allclose(*largest, rtol=1e-8)


@pytest.mark.parametrize("young", [1e8, 1e-10])
def test_phases_of_very_different_stiffness_stay_apart(comm, young):
    materials = {"matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": young, "poisson": 0.2}}
    torn, L, responses = solve(make_case(**RANDOM | materials), comm, policy=POLICIES["pieces"])
    assert not torn.summary.across and all(r.state.iterations < 40 for r in responses)
    # At 1e8 rounding in the monolithic factor is 1e-8.
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-7


@pytest.mark.parametrize(("plane", "fibre"), [("generalized", "glass"), ("stress", "glass"), ("generalized", "carbon")])
def test_fields_and_derivatives_are_those_by_bodies(comm, plane, fibre):
    asked = {"output": {"sensitivities": True}, "analysis": {"type": "stiffness", "plane": plane}}
    runs = [document(cut) | asked for cut in ("auto", "bodies")]
    if fibre == "carbon":  # without a pressure of its own in elements, which matrix and coatings have
        expansion = {"expansion_axial": -1e-6, "expansion_transverse": 1e-5}
        for each in runs:
            each["cell"] |= {"order": 2, "mesh_size": 0.2}
            each["material"]["fibre"] = CARBON | expansion
    across, bodies = (run(Case.parse(each), comm, fields=True) for each in runs)
    assert across.solver.subdomains == comm.size < bodies.solver.subdomains
    assert across.solver.interface_nodes == bodies.solver.interface_nodes > 0
    for name in ("fractions", "elements", "area"):
        assert getattr(across.cell, name) == pytest.approx(getattr(bodies.cell, name), rel=1e-12)
    for name in ("effective_stiffness", *(["thermal_expansion"] if plane == "generalized" else [])):
        ours, expected = (np.asarray(getattr(result, name)) for result in (across, bodies))
        np.testing.assert_allclose(ours, expected, atol=1e-9 * np.abs(expected).max())
    # Stresses are recovered within pieces, and of bodies from a coarser mesh.
    assert across.mesh_error.energy == pytest.approx(bodies.mesh_error.energy, rel=0.3 if fibre == "glass" else 0.5)
    values = across.sensitivities.derivatives, bodies.sensitivities.derivatives
    np.testing.assert_allclose(*values, rtol=1e-7, atol=1e-9 * np.abs(values[1]).max())
    names = ["traction", "jump", "displacement_matrix", *(["axial_traction"] if plane == "generalized" else [])]
    for state, other in zip(across.fields.states, bodies.fields.states, strict=True):
        ours, theirs = (
            [np.concatenate(comm.allgather(part)) for part in (of.interface.points, *(getattr(s, n) for n in names))]
            for of, s in ((across.fields, state), (bodies.fields, other))
        )
        off, place = cKDTree(theirs[0] % 1.0, boxsize=1.0).query(ours[0] % 1.0)
        # Displacements are those of one image of a node: compared where both runs have the same image.
        is_same = np.abs(ours[0] - theirs[0][place]).max(axis=1) < 0.5
        assert is_same.mean() > 0.95
        assert len(ours[0]) == across.solver.interface_nodes and off.max() < 1e-12
        for name, own, their in zip(names, ours[1:], theirs[1:], strict=True):
            part = is_same if name.startswith("displacement") else slice(None)
            np.testing.assert_allclose(own[part], their[place][part], atol=1e-7 * np.abs(their).max() + 1e-9)


STRIPS = {
    "coated": {
        "geometry": "random", "fibres": 3, "fibre_fraction": 0.3, "mesh_size": 0.035, "refine": 2, "coating": 0.2,
    },
    "hollow": {
        "geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.07, "refine": 3,
        "fibre_list": [
            {"x": 0.3, "y": 0.3, "radius": 0.2, "inner_radius": 0.1}, {"x": 0.75, "y": 0.8, "radius": 0.15},
        ],
    },
}  # fmt: skip


@pytest.mark.few_ranks
@pytest.mark.parametrize(("kind", "plane"), [("coated", "generalized"), ("hollow", "strain")])
def test_strips_of_two_ranks_give_what_bodies_of_one_give(comm, kind, plane):
    """Each rank condenses half of a larger cell to its boundary by CHOLMOD."""
    if comm.size != 2:
        pytest.skip("on two ranks")
    case = document("auto") | {"cell": STRIPS[kind], "analysis": {"type": "stiffness", "plane": plane}}
    case["output"] = {"fields": False, "sensitivities": True}
    if kind != "coated":
        del case["material"]["coating"]
    across = run(Case.parse(case), comm)
    bodies = run(Case.parse(case | {"decomposition": {"cut": "bodies"}}), MPI.COMM_SELF)
    assert across.solver.subdomains == 2 < bodies.solver.subdomains
    assert across.solver.dofs > PartitionPolicy().strip_dofs
    for name in ("effective_stiffness", "thermal_expansion"):
        if (expected := getattr(bodies, name)) is not None:
            np.testing.assert_allclose(getattr(across, name), expected, atol=1e-9 * np.abs(expected).max())
    values = across.sensitivities.derivatives, bodies.sensitivities.derivatives
    np.testing.assert_allclose(*values, rtol=1e-7, atol=1e-9 * np.abs(values[1]).max())


@pytest.mark.few_ranks
@pytest.mark.parametrize("kind", STRIPS)
def test_displacements_of_kept_factors_are_those_of_interiors(comm, kind):
    if comm.size != 2:
        pytest.skip("on two ranks")
    case = document("auto") | {"cell": STRIPS[kind]}
    if kind != "coated":
        del case["material"]["coating"]
    rng, progress = np.random.default_rng(comm.rank), Progress(comm, quiet=True)
    asked, unasked = (
        tear(Case.parse(case | {"output": {"fields": False, "mesh_error": on}}), comm, progress, policy=BY_COST)
        for on in (True, False)
    )
    (kept,), (freed,) = (cell.solver.interface_operators.operators for cell in (asked, unasked))
    assert kept.factor is not None and freed.factor is None
    u, loads = rng.normal(size=(kept.n, 3)), rng.normal(size=(len(asked.solver.problem.loads), 3))
    for given in (loads, None):
        found, expected = (cell.solver.interface_operators.extend(0, u, given) for cell in (asked, unasked))
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
    asked.destroy()
    unasked.destroy()
