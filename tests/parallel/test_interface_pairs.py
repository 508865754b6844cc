"""Interfaces between pairs of phases: against cells in which one pair is all that there is, and on their own files."""

import numpy as np
import pytest
from mpi4py import MPI
from support import cases
from support.ranks import assert_certified
from support.void_cells import write_rings
from unit.mesh.faulty_meshes import MATRIX, grid, node

from feti_homog import run
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = pytest.mark.parallel

EPOXY, GLASS = {"young": 2.79, "poisson": 0.33}, {"young": 70.8, "poisson": 0.22}
BETWEEN = {"young": 10.0, "poisson": 0.3}
STRONG = {"normal_strength": 0.06, "tangential_strength": 0.08}
SPRINGS = {"normal_stiffness": 20.0, "tangential_stiffness": 5.0}
ENERGY = {"criterion": "energy", "normal_stiffness": 2.0, "tangential_stiffness": 0.5, "toughness": 4e-4}
LAWS = {
    "strength": STRONG,
    "springs": SPRINGS | STRONG | {"criterion": "quadratic"},
    "energy": ENERGY,
    "energy of springs": ENERGY | {"growth": "springs"},
}
PATH = {"to": {"E11": 0.2, "E22": 0.0, "gamma12": 0.05}}
OUTER, INNER = ["fibre:2", "matrix"], ["fibre", "fibre:2"]


def case_of(folder, name, materials, interface, fields=False, **analysis):
    materials = dict(zip(("matrix", "fibre", "fibre:2"), materials, strict=False))
    sections = {"material": materials, "interface": interface, "output": {"pictures": False, "fields": fields}}
    return cases.case_of({"geometry": "mesh", "file": f"{name}.msh"}, folder, **sections, **analysis)


@pytest.fixture
def meshes(comm, shared_path):
    """Provide a fibre in two rings: of one phase, of two, and with a ring of the matrix."""

    def write():
        for name, core, ring in (("plain", "fibre", "fibre"), ("coated", *INNER), ("core", "fibre", "matrix")):
            write_rings(shared_path / f"{name}.msh", core, ring)

    on_root(comm, write)
    return shared_path


@pytest.mark.few_ranks
@pytest.mark.parametrize(
    "law, between, plain, ring",
    [
        *(("strength", OUTER, "plain", GLASS), ("springs", INNER, "core", EPOXY), ("energy", INNER, "core", EPOXY)),
        ("energy of springs", OUTER, "plain", GLASS),
    ],
    ids=LAWS,
)
def test_one_of_two_interfaces_breaks_as_if_it_were_alone(comm, meshes, law, between, plain, ring):
    """A coating of the material of the fibre whose outer side breaks is part of it; of the matrix, part of that."""
    alone = run(case_of(meshes, plain, (EPOXY, GLASS), LAWS[law], path=PATH), comm)
    named = LAWS[law] | {"between": between}
    found = run(case_of(meshes, "coated", (EPOXY, GLASS, ring), named, path=PATH), comm)
    assert [point.broke for point in found.path] == [point.broke for point in alone.path]
    assert len(alone.path) > 4
    stress = np.array([point.stress for point in alone.path])
    assert np.array([point.stress for point in found.path]) == pytest.approx(stress, abs=1e-9 * np.abs(stress).max())
    assert sum(found.path[-1].debonded_length) == pytest.approx(sum(alone.path[-1].debonded_length), rel=1e-9)


@pytest.mark.few_ranks
@pytest.mark.parametrize("laws", [("strength", {"normal_strength": 0.05}), ("energy", {"toughness": 3e-4})], ids=str)
def test_both_interfaces_break_as_their_files_certify(comm, meshes, laws):
    law, other = LAWS[laws[0]], LAWS[laws[0]] | SPRINGS | laws[1]
    interfaces = [law | {"between": INNER}, other | {"between": OUTER}]
    case = case_of(meshes, "coated", (EPOXY, GLASS, BETWEEN), interfaces, fields=True, path=PATH)
    result = run(case, comm, out=meshes / "out")
    assert result.status == "done" and len(result.path) > 4
    assert_certified(comm, meshes / "out")


def two_fibres():
    """Return a mesh of two fibres of unlike names, one above the other."""
    mesh = grid(lambda x, y: 0.25 < x < 0.5 and y < 0.75)
    second = {tag: e for tag, e in mesh.elements.items() if e[1] != MATRIX and min(e[3]) >= node(0, 2)}
    for tag, (kind, _, _, nodes) in second.items():
        mesh = mesh.with_element(tag, kind, 3, nodes)
    mesh.names[3] = "fibre:2"
    return mesh


def test_unlike_cohesive_pairs_soften_alike_on_ranks_that_own_one_pair_or_none(comm, shared_path):
    """Bodies are not cut: each pair is on a rank of its own, and another rank has no interface nodes."""
    if comm.size < 3:
        pytest.skip("two ranks have all nodes on one of them")
    on_root(comm, two_fibres().write, shared_path / "two.msh")
    law = STRONG | {"law": "bilinear", "normal_stiffness": 20.0, "tangential_stiffness": 20.0}
    law |= {"softening_tolerance": 0.2}
    unlike = [
        law | {"between": ["matrix", name], "normal_toughness": G, "tangential_toughness": 2 * G}
        for name, G in (("fibre", 1e-3), ("fibre:2", 3e-4))
    ]
    case = case_of(shared_path, "two", (EPOXY, GLASS, GLASS), unlike, path={"to": {"E11": 0.06, "gamma12": 0.03}})
    found, alone = run(case, comm).path, on_root(comm, lambda: run(case, MPI.COMM_SELF).path)
    assert [point.softened for point in found] == [point.softened for point in alone] and len(alone) > 5
    stress = np.array([point.stress for point in alone])
    np.testing.assert_allclose([point.stress for point in found], stress, atol=1e-8 * np.abs(stress).max())


@pytest.mark.few_ranks
def test_springs_of_a_laminate_are_in_series(comm, shared_path):
    """1 / C11 = sum of c / M and of 1 / (k_n W), M = lambda + 2 mu: four interfaces of two stiffnesses, exact."""
    mesh = grid(lambda x, y: 0.25 < x < 0.75)
    for tag, (kind, physical, _, nodes) in list(mesh.elements.items()):
        if physical != MATRIX and min((n - 1) % 5 for n in nodes) >= 2:
            mesh = mesh.with_element(tag, kind, 3, nodes)
    mesh.names[3] = "fibre:2"
    on_root(comm, mesh.write, shared_path / "strips.msh")
    pairs = {("matrix", "fibre"): 30.0, ("fibre:2", "fibre"): 7.0, ("fibre:2", "matrix"): 50.0}
    interfaces = [{"between": list(pair), "normal_stiffness": k} for pair, k in pairs.items()]
    case = case_of(shared_path, "strips", (EPOXY, GLASS, BETWEEN), interfaces, stiffness=None)
    found = run(case, comm).effective_stiffness
    constrained = [
        m["young"] * (1 - m["poisson"]) / (1 + m["poisson"]) / (1 - 2 * m["poisson"]) for m in (EPOXY, GLASS, BETWEEN)
    ]
    compliance = (
        0.5 / constrained[0] + 0.25 / constrained[1] + 0.25 / constrained[2] + sum(1 / k for k in pairs.values())
    )
    assert found[0, 0] == pytest.approx(1 / compliance, rel=1e-9)


@pytest.mark.few_ranks
def test_an_envelope_of_two_interfaces_tells_which_breaks_first(comm, shared_path):
    """Its onset is the lesser of the two of one interface each."""
    cell = {"geometry": "square", "fibre_fraction": 0.3, "coating": 0.2, "mesh_size": 0.12}
    material = {"matrix": EPOXY, "fibre": GLASS, "coating": {"young": 1.5, "poisson": 0.35}}
    sections = [
        {"between": ["coating", "matrix"], "normal_strength": 0.05, "tangential_strength": 0.05},
        {"between": ["fibre", "coating"], "normal_strength": 0.05, "tangential_strength": 0.04},
    ]

    def onsets(chosen, out=None):
        envelope = {"plane": ["S11", "S12"], "directions": 12}
        case = cases.case_of(cell, material=material, interface=chosen, envelope=envelope, petsc={})
        return run(case, comm, out=out).envelope

    both, *each = onsets(sections, shared_path / "run"), *(onsets([section]) for section in sections)
    for point, *own in zip(both, *each, strict=True):
        factors = [other.factor for other in own]
        assert point.factor == pytest.approx(min(factors), rel=1e-9)
        assert point.interface == 1 + int(np.argmin(factors)) and own[0].interface is None
    assert {point.interface for point in both} == {1, 2}
    assert_certified(comm, shared_path / "run")
    if comm.rank == 0:
        assert "interface" in (shared_path / "run/envelope.csv").read_text().splitlines()[0]
    comm.barrier()
