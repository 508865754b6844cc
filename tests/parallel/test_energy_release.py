"""Energy release rates at tips, on all numbers of ranks.

They are compared with differences of the energy, published numbers and laws.
"""

import numpy as np
import pytest
from reference.references import DEBONDED_FIBRE_BEM, DEBONDED_FIBRE_FEM, DEBONDED_FIBRE_TOTAL
from support.cases import FIBRE, MATRIX, case_of, relative_error
from support.ranks import parallel_assert, write_once
from support.void_cells import write_voids
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid

from feti_homog import run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

SQUARE = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.08, "order": 2}
RADIUS = np.sqrt(0.4 / np.pi)
FREE, TOUCHING, SPRINGS = (
    {"contact": False},
    {"contact": True},
    {"normal_stiffness": 1000.0, "tangential_stiffness": 250.0},
)
ORTHOTROPIC = {"E1": 40.0, "E2": 15.0, "E3": 15.0, "nu12": 0.25, "nu13": 0.25, "nu23": 0.3, "G12": 6.0, "angle": 20.0}
# Half of the difference of two openings, in degrees.
STEP = 0.5


def solved(comm, strain, openings, bond, arc=(), materials=(), pieces=None, folder=".", **cell):
    """Return the points of an angle under a strain, and the area of the cell."""
    case = case_of(
        SQUARE | cell,
        folder,
        material={"matrix": MATRIX, "fibre": FIBRE} | dict(materials),
        interface={"debonded": [{"fibre": 1} | dict(arc)]} | bond,
        angle={"values": openings, "strain": strain},
        decomposition=pieces,
    )
    result = run(case, comm)
    return result.angle, result.cell.area


def rates(comm, strain, opening, bond, **case):
    """G of the tips at an opening, and -dE / da of both tips together, from two other openings on a mesh of theirs."""
    (point,), area = solved(comm, strain, [opening], bond, **case)
    energies = [
        area * np.dot(other.stress, strain) / 2
        for half in (-STEP, STEP)
        for other in solved(comm, strain, [opening + 2 * half], bond, **case)[0]
    ]
    return point.tips, (energies[0] - energies[1]) / (2 * np.radians(STEP) * RADIUS)


@pytest.mark.parametrize(
    ("bond", "strain"),
    [
        (FREE, [0.3, 0.2, 0.5]),
        (TOUCHING, [-1.0, 0.0, 0.0]),
        (TOUCHING, [0.3, -0.5, 0.4]),
    ],
)
def test_the_total_is_what_the_energy_loses(comm, bond, strain):
    """From analyses of two other openings, whatever the modes."""
    tips, expected = rates(comm, strain, 120.0, bond, mesh_size=0.05)
    parallel_assert(comm, len(tips.G) == 2 and abs(tips.G.sum() / expected - 1) < 2e-3)
    parallel_assert(comm, np.abs(tips.G_I + tips.G_II - tips.G).max() < 1e-12)


@pytest.mark.parametrize(
    ("case", "error"),
    [
        ({"order": 1, "refine": 2}, 6e-3),
        ({"materials": {"fibre": ORTHOTROPIC}}, 3e-3),
        ({"bodies": "plane", "pieces": {"subdomains": 7}}, 3e-3),
        ({"fibre_fraction": 0.7, "arc": {"centre": 20.0}}, 3e-3),
    ],
    ids=["linear", "anisotropic", "pieces", "narrow"],
)
def test_so_it_is_on_other_meshes_and_of_other_phases(comm, case, error):
    tips, expected = rates(comm, [1.0, 0.2, 0.3], 100.0, FREE, **case)
    radius = np.sqrt(case.get("fibre_fraction", 0.4) / np.pi)
    parallel_assert(comm, abs(tips.G.sum() * radius / RADIUS / expected - 1) < error)


@pytest.mark.parametrize("strain", [[-1.0, 0.0, 0.0], [0.3, -0.5, 0.4]])
def test_so_it_is_with_elastic_bonds(comm, strain):
    tips, expected = rates(comm, strain, 120.0, SPRINGS, mesh_size=0.02)
    parallel_assert(comm, abs(tips.G.sum() / expected - 1) < 5e-3)
    if strain == [-1.0, 0.0, 0.0]:
        parallel_assert(comm, bool((tips.G_I == 0.0).all() and (tips.psi == 90.0).all()))


@pytest.mark.parametrize(
    ("bond", "reference"), [(SPRINGS, SPRINGS), ({name: 2000 * k for name, k in SPRINGS.items()}, FREE)]
)
def test_elastic_bonds_need_no_fine_elements_at_tips(comm, bond, reference):
    """The stress in stiff bonds, whose rates are the rates of rigid bonds, rises over less than an element."""
    strain = [1.0, 0.2, 0.3]
    (fine,), _ = solved(comm, strain, [120.0], reference, tip_size=2e-4)
    for cell, error in (({"mesh_size": 0.05}, 2e-3), ({"mesh_size": 0.05, "order": 1}, 2e-2)):
        (point,), _ = solved(comm, strain, [120.0], bond, **cell)
        parallel_assert(comm, np.abs(point.tips.G / fine.tips.G - 1).max() < error, str(point.tips.G / fine.tips.G))


def test_modes_do_not_depend_on_the_mesh(comm):
    """Modes belong to a length of R / 1000, if the elements are smaller."""
    angles = []
    for cell in ({"tip_size": 3e-4}, {"tip_size": 2e-5}, {"tip_size": 1e-4, "refine": 1, "order": 1}):
        (point,), _ = solved(comm, [1.0, 0.0, 0.0], [120.0], FREE, **cell)
        parallel_assert(comm, np.abs(point.tips.length / (1e-3 * RADIUS) - 1).max() < 1e-6)
        angles.append(point.tips.psi[0])
    parallel_assert(comm, max(angles) - min(angles) < 1.0, str(angles))


@pytest.mark.parametrize("opening", [0.0, 360.0])
def test_without_tips_there_is_no_rate(comm, opening):
    (point,), _ = solved(comm, [1.0, 0.0, 0.0], [opening], TOUCHING, order=1)
    parallel_assert(comm, point.tips.load == () and len(point.tips.G) == 0)


def test_stiffness_has_the_tips_of_all_its_loads(comm):
    cell = SQUARE | {"order": 1}
    arc, totals = {"debonded": [{"fibre": 1, "angle": 90.0, "centre": 30.0}]}, []
    parallel_assert(comm, run(case_of(cell), comm).tips is None)
    for contact, loads in (
        (False, ("E11", "E22", "gamma12")),
        (True, ("E11", "E22", "gamma12", "-E11", "-E22", "-gamma12")),
    ):
        tips = run(case_of(cell, interface=arc | {"contact": contact}), comm).tips
        expected = [(load, angle) for load in loads for angle in (-15.0, 75.0)]
        found = list(zip(tips.load, np.round(tips.angle, 6).tolist(), strict=True))
        parallel_assert(comm, found == expected and bool((tips.G >= 0).all()))
        totals.append(tips.G[:2])
    parallel_assert(comm, totals[1] == pytest.approx(totals[0], rel=1e-6))


def test_a_remark_names_fibres_whose_tips_have_no_rate(comm):
    """Only tips on circles have rates; a fibre that is debonded all around has no tips."""
    shapes = [{"x": 0.5, "y": 0.5, "radius": 0.2}, *({"x": x, "y": 0.5, "a": 0.4, "b": 0.2} for x in (1.5, 2.5))]
    cell = {"geometry": "table", "width": 3.0, "height": 1.0, "mesh_size": 0.1, "fibre_list": shapes}
    arcs = [{"fibre": k, "centre": 0.0, "angle": angle} for k, angle in ((1, 20.0), (2, 120.0), (3, 360.0))]
    result = run(case_of(cell, interface={"debonded": arcs, "contact": False}), comm)
    parallel_assert(comm, set(result.tips.fibre) == {1})
    lines = [line for line in result.remarks if "no energy release rates" in line]
    parallel_assert(comm, lines == ["[interface] fibre 2: no energy release rates at tips, which only circles have"])


@pytest.mark.parametrize(("load", "label"), [({"S11": 0.1}, "load"), ({"E11": 0.01, "E22": 0.0}, "strain")])
def test_tips_name_a_load_by_what_it_gives(comm, load, label):
    arc = {"debonded": [{"fibre": 1, "angle": 90.0, "centre": 30.0}]}
    case = case_of(SQUARE | {"order": 1}, load={"to": load}, interface=arc)
    parallel_assert(comm, set(run(case, comm).load.tips.load) == {label})


def test_fibres_that_are_not_round_have_no_tips(comm, shared_path):
    """A square one, debonded on its right side."""
    write_once(comm, grid().with_curve(RIGHT_SIDE), shared_path / "grid.msh")
    case = case_of({"geometry": "mesh", "file": "grid.msh", "refine": 1}, shared_path, interface={})
    result = run(case, comm)
    parallel_assert(comm, result.tips.load == ())
    comm.barrier()


def test_one_fibre_in_a_large_matrix_has_the_published_rates(comm):
    """In a cell 40 radii wide, whose strain is that of the matrix under uniaxial stress."""
    young, poisson, widths = 3.5, 0.4, 40
    shear, kappa = young / (2 * (1 + poisson)), 3 - 4 * poisson
    cell = {"fibre_fraction": np.pi / widths**2, "fibre_radius": 1.0, "mesh_size": 0.05}
    cell |= {"interface_size": 0.06 / widths, "tip_size": 6e-4 / widths}
    materials = {"matrix": {"young": young, "poisson": poisson}, "fibre": {"young": 70.0, "poisson": 0.2}}
    strain = [(1 - poisson**2) / young, -poisson * (1 + poisson) / young, 0.0]
    points, _ = solved(comm, strain, [2.0 * t for t in DEBONDED_FIBRE_TOTAL], TOUCHING, (), materials, **cell)
    largest = max(reference.value[0] for reference in DEBONDED_FIBRE_TOTAL.values())
    for point in points:
        t, scale = round(point.angle / 2), (1 + kappa) / (8 * shear) * np.pi * point.stress[0] ** 2
        total, modes = point.tips.G / scale, np.stack([point.tips.G_I, point.tips.G_II], axis=1) / scale
        for expected in (DEBONDED_FIBRE_TOTAL[t].value[0], sum(DEBONDED_FIBRE_FEM[t])):
            parallel_assert(comm, np.abs(total - expected).max() < 5e-3 * largest, f"{t}: {total}")
        parallel_assert(comm, np.abs(modes - DEBONDED_FIBRE_FEM[t]).max() < 0.015 * largest, f"{t}: {modes}")
        parallel_assert(comm, np.abs(modes - DEBONDED_FIBRE_BEM[t]).max() < 0.06 * largest, f"{t}: {modes}")


def loaded(comm, cell, arcs, materials=(), folder="."):
    """Return the point of a load on the cell, whose arcs are 100 degrees long by default."""
    materials, load = {"matrix": MATRIX, "fibre": FIBRE} | dict(materials), {"E11": 0.3, "E22": 0.2, "gamma12": 0.5}
    bonds = {"debonded": [{"angle": 100.0} | arc for arc in arcs]} | FREE
    return run(case_of(cell, folder, material=materials, interface=bonds, load={"to": load}), comm).load


@pytest.mark.quick
@pytest.mark.parametrize("centre", [0.0, 100.0])
def test_beside_a_void_rates_are_those_beside_a_fibre_that_nothing_holds(comm, shared_path, centre):
    """On one mesh; one tip is so near that the void would be within reach of its extension."""
    cell = {"geometry": "random", "fibres": 2, "fibre_fraction": 0.35, "min_gap": 0.1, "seed": 1, "mesh_size": 0.08}
    if comm.rank == 0:
        write_voids(shared_path / "fibres.msh", voids=[], **cell)
        write_voids(shared_path / "void.msh", voids=[0], **cell)  # fibre 2
    comm.barrier()
    own, other = {"fibre": 1, "centre": centre}, {"fibre": 2, "centre": 0.0, "angle": 360.0}
    mesh = {"geometry": "mesh", "order": 2}
    expected = loaded(comm, mesh | {"file": "fibres.msh"}, [own, other], folder=shared_path)
    found = loaded(comm, mesh | {"file": "void.msh", "voids": True}, [own], folder=shared_path)
    assert relative_error(found.stress, expected.stress) < 1e-8
    assert relative_error(found.tips.G, expected.tips.G[np.array(expected.tips.fibre) == 1]) < 1e-7


@pytest.mark.parametrize("coating", [0.3, 0.02])
def test_rates_of_coated_fibres_are_those_of_fibres_of_one_material(comm, coating):
    """The fibres have the same outer radius, on another mesh; a coated fibre is bonded to its coating."""
    radius, arc = 0.3, {"fibre": 1, "centre": 20.0}
    cell = {"geometry": "square", "mesh_size": 0.08, "interface_size": 0.04, "order": 2}
    expected = loaded(comm, cell | {"fibre_fraction": np.pi * radius**2}, [arc])
    within = {"fibre_fraction": np.pi * (radius / (1 + coating)) ** 2, "coating": coating}
    found = loaded(comm, cell | within, [arc], {"coating": FIBRE})
    assert relative_error(found.tips.G, expected.tips.G) < 2e-3


INNER, OUTER = ["fibre", "coating"], ["coating", "matrix"]


@pytest.mark.parametrize(("growing", "bond"), [(OUTER, FREE), (INNER, TOUCHING)], ids=["outer", "inner"])
def test_each_interface_of_a_coated_fibre_releases_what_the_energy_loses(comm, growing, bond):
    """While the arc on the other interface stays as long as it is."""
    radius, coating, strain = 0.25, 0.3, {"E11": 0.3, "E22": -0.5, "gamma12": 0.4}
    cell = {"fibre_fraction": np.pi * radius**2, "coating": coating, "mesh_size": 0.05, "order": 2}

    def solved_with(opening):
        arcs = [{"fibre": 1, "centre": 20.0, "angle": opening if name == growing else 70.0} for name in (INNER, OUTER)]
        materials = {"matrix": MATRIX, "fibre": FIBRE, "coating": {"young": 20.0, "poisson": 0.3}}
        bonds = [{"between": pair, "debonded": [arc]} | bond for pair, arc in zip((INNER, OUTER), arcs, strict=True)]
        return run(case_of(SQUARE | cell, material=materials, interface=bonds, load={"to": strain}), comm).load

    energies = [np.dot(solved_with(100.0 + 2 * half).stress, list(strain.values())) / 2 for half in (-STEP, STEP)]
    tips, own = solved_with(100.0).tips, 1 + [INNER, OUTER].index(growing)
    lost = (energies[0] - energies[1]) / (2 * np.radians(STEP) * radius * (1.0 if own == 1 else 1 + coating))
    parallel_assert(comm, tips.interface == (1, 1, 2, 2) and set(tips.fibre) == {1})
    found = tips.G[np.array(tips.interface) == own].sum()
    assert abs(found / lost - 1) < 2e-3, (found, lost)
