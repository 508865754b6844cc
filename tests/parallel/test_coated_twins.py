"""Two interfaces of coated fibres that break together, or are debonded in part, against brute force."""

import numpy as np
import pytest
from petsc4py import PETSc
from reference.energy_path import SlowEnergyPath
from reference.load_path import SlowLoadPath
from support import torn_cells
from support.cases import relative_error
from support.load_paths import followed

from feti_homog import Case
from feti_homog.analysis.tip_records import criterion_of
from feti_homog.homogenization import unit_cell
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.loads import Load
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.parallel

EPOXY, GLASS, COATING = ((1.0, 0.35), (20.0, 0.2), (4.0, 0.3))
PAIRS = (["coating", "matrix"], ["fibre", "coating"])
CELLS = {
    "square": {"geometry": "square", "fibre_fraction": 0.25, "coating": 0.4, "mesh_size": 0.2},
    "quadratic": {"geometry": "square", "fibre_fraction": 0.25, "coating": 0.4, "mesh_size": 0.25, "order": 2},
    "two": {"geometry": "random", "fibres": 2, "fibre_fraction": 0.2, "coating": 0.4, "min_gap": 0.1, "mesh_size": 0.2},
}
TARGETS = {"shear": [0.3, -0.2, 1.0], "tension": [1.0, 0.1, 0.2]}
SPRINGS = (
    {"normal_stiffness": 30.0, "tangential_stiffness": 12.0},
    {"normal_stiffness": 9.0, "tangential_stiffness": 20.0},
)
ENERGY = ({"toughness": 1.4e-4, "mode_sensitivity": 0.3}, {"toughness": 1e-4, "mode_sensitivity": 0.6})
STRENGTHS = (
    {"normal_strength": 0.05, "tangential_strength": 0.06},
    {"normal_strength": 0.054, "tangential_strength": 0.04},
)


@pytest.fixture
def twin(comm):
    """twin(cell, (outer, inner interface), strain of a path): the torn cell and its programme.  Collective."""
    made = []

    def make(cell, interfaces, strain=(1.0, 0.0, 0.0)):
        document = {
            "cell": CELLS[cell],
            "material": {
                name: {"young": young, "poisson": poisson}
                for name, (young, poisson) in {"matrix": EPOXY, "fibre": GLASS, "coating": COATING}.items()
            },
            "interface": [own | {"between": pair} for own, pair in zip(interfaces, PAIRS, strict=True)],
            "analysis": {"type": "path", "plane": "strain"},
            "path": {"strain": list(strain)},
            "petsc": {"feti_ksp_rtol": 1e-11, "feti_pc_type": "influence"},
        }
        case = Case.parse(document)
        PETSc.garbage_cleanup(comm)
        with case_options(case.petsc):
            made.append(unit_cell.tear(case, comm, Progress(comm, quiet=True)))
        return torn_cells.referenced(made[-1])

    yield make
    for cell in made:
        cell.destroy()


def of_nodes(programme, name, tables):
    """(k,) the value of a key at each node, from the tables of the outer and of the inner interface."""
    circles = programme.rigid.shape[2]
    return np.where(programme.fibre < circles // 2, *(table[name] for table in tables))


def compare(case, expected, strain):
    """Compare broken bonds, loads and stresses of the path with the events; bonds of both pairs break."""
    interface = torn_cells.interface(case.cell, True)
    points = followed(interface, criterion_of(case.cell, grows=True), [strain])
    found = np.array([case.in_reference_order(p.after.bonds.status) != BONDED for p in points])
    np.testing.assert_array_equal(found, np.cumsum([e.broke for e in expected], axis=0) > 0)
    assert relative_error(np.array([p.load_factor for p in points]), [e.load_factor for e in expected]) < 1e-8
    stress = np.array([p.scale * torn_cells.stress(case.cell, p.state.solution) for p in points])
    assert relative_error(stress, np.array([e.stress for e in expected])) < 1e-7
    assert all(p.state.solution.reason > 0 and max(p.state.certificate.values()) < 1e-8 for p in points)
    pair = case.in_reference_order(case.cell.solver.jump_operator.nodes.pair)
    assert all(found[-1][pair == number].any() for number in (0, 1)) and len(points) > 5


@pytest.mark.one_rank
@pytest.mark.parametrize(("cell", "strain"), [("quadratic", TARGETS["tension"]), ("two", TARGETS["shear"])], ids=str)
def test_strengths_of_two_pairs_break_as_by_brute_force(comm, twin, cell, strain):
    case = twin(cell, STRENGTHS, strain)

    def brute_force():
        own = (of_nodes(case.reference, f"{which}_strength", STRENGTHS) for which in ("normal", "tangential"))
        return SlowLoadPath(case.reference, True, *own, "max").proportional(np.array(strain))

    compare(case, on_root(comm, brute_force), strain)


@pytest.mark.one_rank
@pytest.mark.parametrize(("cell", "growth"), [("two", "released"), ("quadratic", "springs")])
def test_energies_of_two_pairs_break_as_by_brute_force(comm, twin, cell, growth):
    strain = [0.5, 0.05, 0.1]
    common = {"criterion": "energy", "growth": growth}
    interfaces = [common | springs | energy for springs, energy in zip(SPRINGS, ENERGY, strict=True)]
    case = twin(cell, interfaces, strain)

    def brute_force():
        names = ("normal_stiffness", "tangential_stiffness", "toughness", "mode_sensitivity")
        kn, kt, toughness, sensitivity = (of_nodes(case.reference, name, interfaces) for name in names)
        slow = SlowEnergyPath(case.reference, (kn, kt), toughness, sensitivity, growth)
        return slow.proportional(np.array(strain))

    compare(case, on_root(comm, brute_force), strain)


@pytest.mark.parametrize("springs", [None, SPRINGS], ids=["glue", "springs"])
@pytest.mark.parametrize("number", range(4))
def test_random_debonding_of_two_pairs_in_contact_is_that_of_the_quadratic_programme(comm, twin, number, springs):
    """Debond each pair alone, so that the coating stays with the fibre or with the matrix, then both."""
    case = twin(list(CELLS)[number % 3], springs or STRENGTHS)
    interface, pair = torn_cells.interface(case.cell, True), case.cell.solver.jump_operator.nodes.pair
    pair, rng = case.in_reference_order(pair), np.random.default_rng(number)
    for debonded in ([0], [1], [0, 1]):
        bonded = ~(np.isin(pair, debonded) & (rng.random(len(pair)) < rng.choice([0.5, 0.8, 1.0])))
        strain = rng.normal(size=3)

        def brute_force(strain=strain, bonded=bonded):
            if springs is None:
                return case.reference.solve(strain, bonded, True)
            own = [of_nodes(case.reference, name, springs) for name in springs[0]]
            return case.reference.solve_elastic(strain, bonded, True, own)

        expected = on_root(comm, brute_force)
        state = interface.equilibrium(Load.strain(strain), torn_cells.bonds(case.status(bonded)), case.start())
        assert state.solution.reason > 0 and max(state.certificate.values()) < 1e-8
        assert relative_error(torn_cells.stress(case.cell, state.solution), expected.stress) < 1e-7
        status = case.in_reference_order(state.status)
        tight = ~bonded & (expected.force[:, 0] < -1e-6 * np.abs(expected.stress).max())
        apart = ~bonded & (expected.jump[:, 0] > 1e-6 * np.abs(strain).max())
        assert (status[tight] == CLOSED).all() and (status[apart] == OPEN).all()
