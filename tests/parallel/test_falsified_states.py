"""States with one fault each: its check rises by what was put in, no other does, and all ranks find the same."""

from dataclasses import replace

import numpy as np
import pytest
from support import torn_cells
from support.ranks import PIECES, parallel_assert

from feti_homog.analysis import stiffness
from feti_homog.analysis.context import AnalysisContext, CellLoads
from feti_homog.case.interface_section import Arc
from feti_homog.homogenization.averaging import Homogenization
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.friction.face_system import Prescribed
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.loads import Load
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

NOISE = 1e-8
WIDTH, MATRIX, FIBRE = 3.0, {"young": 88.0, "poisson": 0.299}, {"young": 200.0, "poisson": 0.222}
PULLED, PRESSED = np.array([0.03, 0.02, 0.01]), np.array([-0.03, -0.02, 0.01])
ARC = Arc(fibre="all", centre=20.0, angle=130.0)


class Falsified:
    """A cell with an arc that may touch, its states, and falsified ones."""

    def __init__(self, cell):
        self.cell, self.comm, self.homogenization = cell, cell.comm, Homogenization(cell, contact=True)
        self.interface, self.arc = self.homogenization.interface, cell.debonded(None)
        self.row = self.interface.nodes.row

    def status(self, kind, where=None):
        """Give the nodes of the arc, or some of them, this status, and open the others of the arc."""
        return np.select([self.arc if where is None else where, self.arc], [kind, OPEN], BONDED).astype(np.int8)

    def solution(self, strain, status):
        return self.interface.linear(Load.strain(strain), torn_cells.bonds(status), np.zeros(self.cell.solver.rows))

    def checks(self, solution, status, load=None):
        """Return the checks of a state that is taken as found."""
        found = self.interface._equilibrium(
            load or Load.strain(solution.strain), torn_cells.bonds(status), solution, 1, 1
        )
        response = self.homogenization.response(replace(found, bonds=torn_cells.bonds(status)), 1.0)
        alike = self.comm.allgather(response.checks)
        assert all(checks == alike[0] for checks in alike)
        return response.checks

    def assert_only(self, checks, **expected):
        """Check that these checks rise and the others stay noise."""
        for law, error in checks.items():
            if law in expected:
                assert error == pytest.approx(expected[law], rel=1e-6), law
            else:
                assert error < NOISE, law

    def everywhere(self, values):
        return np.concatenate(self.comm.allgather(values))

    def imposed(self, strain):
        """Largest displacement that strains of this size impose on the cell: at its upper right corner."""
        a, b, c = np.abs(strain) * WIDTH
        return max(a, b) + c / 2

    def least_stress(self, strain):
        """Return a stress that strains of this size cause at least, by Reuss' bound."""
        return np.abs(self.reuss() @ np.abs(strain)).max()

    def bond_stress(self, strain):
        """Return a stress that strains of this size cause in the matrix, the softer body of a bond."""
        return sum(bulk_and_shear(MATRIX)) * np.abs(strain).max()

    def bounds(self):
        """(2, 2) Reuss' and Voigt's bounds of the moduli."""
        moduli = np.array([bulk_and_shear(phase) for phase in (MATRIX, FIBRE)])
        x, y = self.polygon().T
        fibre = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2 / WIDTH**2
        shares = np.array([1 - fibre, fibre])
        return 1 / (shares @ (1 / moduli)), shares @ moduli

    def reuss(self):
        """(3, 3) Reuss' bound of the stiffness."""
        K, G = self.bounds()[0]
        return np.array([[K + G, K - G, 0], [K - G, K + G, 0], [0, 0, G]])

    def polygon(self):
        """(p, 2) the interface's nodes around the middle of the fibre, which is that of the cell."""
        points = self.everywhere(self.interface.nodes.points) - WIDTH / 2
        return points[np.argsort(np.arctan2(*points.T[::-1]))]

    def chosen(self, *places):
        """Return which nodes of this rank are these nodes of the arc, counted over all ranks."""
        owned = [np.flatnonzero(arc) + first for first, arc in self._arcs()]
        numbers = np.concatenate(owned)[list(places)]
        first = sum(self.comm.allgather(len(self.row))[: self.comm.rank])
        return np.isin(first + np.arange(len(self.row)), numbers)

    def _arcs(self):
        arcs = self.comm.allgather(self.arc)
        return zip(np.cumsum([0, *map(len, arcs)]), arcs, strict=False)


def bulk_and_shear(phase):
    """Return the moduli of a phase in plane strain."""
    E, nu = phase["young"], phase["poisson"]
    return E / (2 * (1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def mixed(pairs):
    """Return the sum of shares of solutions under one strain."""
    sums = {name: sum(share * getattr(one, name) for share, one in pairs) for name in ("lam", "jump", "alpha")}
    return replace(pairs[0][1], **sums)


def cells_with(**petsc):
    """Provide the cell with these options of the solver."""
    from mpi4py import MPI

    cell = torn_cells.tear(
        MPI.COMM_WORLD, [ARC], geometry="square", mesh_size=0.2, width=WIDTH, decomposition=PIECES,
        petsc={"feti_ksp_rtol": 1e-12} | petsc,
    )  # fmt: skip
    yield Falsified(cell)
    cell.solver.destroy()


@pytest.fixture(scope="module")
def falsified():
    yield from cells_with()


@pytest.fixture(scope="module")
def rubbing():
    yield from cells_with(feti_pc_type="influence")


def test_a_glued_node_that_parts(falsified):
    status, gap = falsified.status(OPEN), 1e-4
    solution = falsified.solution(PULLED, status)
    # The last rank has it.
    parted = np.flatnonzero(status == BONDED)[:1] if falsified.comm.rank == falsified.comm.size - 1 else []
    jump = solution.jump.copy()
    jump[falsified.row[parted] + 1] -= gap
    u = falsified.cell.solver.boundary_displacement(solution)
    largest = np.abs(falsified.everywhere(u)).max() + falsified.imposed(PULLED)
    falsified.assert_only(falsified.checks(replace(solution, jump=jump), status), jump=gap / largest)


def test_slip_that_no_strain_has(falsified):
    """A jump g of a node adds the symmetric part of g a / |UC| to the mean strain, a half of the sides beside it."""
    status, slip = falsified.status(OPEN), 1e-3
    solution, which = falsified.solution(PULLED, status), falsified.chosen(3)
    jump = solution.jump.copy()
    jump[falsified.row[which] + 1] += slip
    nodes, polygon = falsified.interface.nodes, falsified.polygon()
    normal, point = (falsified.everywhere(values[which])[0] for values in (nodes.normal, nodes.points - WIDTH / 2))
    number = np.abs(polygon - point).max(axis=1).argmin()
    (a, b), (c, d) = (
        slip * np.array([-normal[1], normal[0]]),
        polygon[(number + 1) % len(polygon)] - polygon[number - 1],
    )
    gradient = np.array([a * d, -b * c, b * d - a * c]) / 2 / WIDTH**2
    expected = np.abs(gradient).max() / np.abs(PULLED).max()
    falsified.assert_only(falsified.checks(replace(solution, jump=jump), status), strain=expected)


def test_work_that_nobody_does(falsified):
    """Friction on faces that touch, half of what would hold them: <sigma:eps> - Sigma:E = -sum t s / |UC|."""
    status = falsified.status(CLOSED)
    free, held = (falsified.solution(PRESSED, each) for each in (status, falsified.status(BONDED)))
    rubbed = mixed([(0.5, free), (0.5, held)])
    row = falsified.row[falsified.arc]
    parallel_assert(falsified.comm, bool((rubbed.lam[row] < 0).all()), "all are pressed")
    work = falsified.comm.allreduce(float(rubbed.lam[row + 1] @ rubbed.jump[row + 1])) / WIDTH**2
    stress = falsified.interface.stress(rubbed)
    energy = stress @ PRESSED - work
    expected = abs(work) / max(abs(energy), falsified.least_stress(PRESSED) * np.abs(PRESSED).max())
    assert expected > 1e-3
    falsified.assert_only(falsified.checks(rubbed, status), hill=expected)


def test_faces_that_overlap(falsified):
    status = falsified.status(OPEN)
    solution = falsified.solution(PRESSED, status)
    deepest = -falsified.everywhere(solution.jump[falsified.row[falsified.arc]]).min()
    assert deepest > 0
    expected = deepest / falsified.imposed(PRESSED)
    falsified.assert_only(falsified.checks(solution, status), kkt_penetration=expected)


def test_faces_that_touch_and_pull(falsified):
    status = falsified.status(CLOSED)
    solution = falsified.solution(PULLED, status)
    nodes = falsified.interface.nodes
    tractions = falsified.everywhere(solution.lam[falsified.row[:, None] + [0, 1]] / nodes.length[:, None])
    pulled = falsified.everywhere(falsified.arc)
    expected = tractions[pulled, 0].max() / np.abs(tractions).max()
    falsified.assert_only(falsified.checks(solution, status), kkt_tension=expected)


def test_open_faces_that_bear_a_force(falsified):
    """At two nodes, the forces opposite and the gaps alike: together they do no work."""
    places = 1, 4
    status, alone = falsified.status(OPEN), [falsified.chosen(place) for place in places]
    free = falsified.solution(PULLED, status)
    held = [falsified.solution(PULLED, falsified.status(CLOSED, which)) for which in alone]
    force = [falsified.everywhere(one.lam[falsified.row[which]])[0] for one, which in zip(held, alone, strict=True)]
    gap = np.array([[falsified.everywhere(one.jump[falsified.row[w]])[0] for w in alone] for one in (free, *held)])
    # Shares 1 - t / f1 + t / f2, t / f1 and -t / f2 of the states have the forces t and -t.
    change = -gap[0] / force[0] + gap[0] / force[1] + gap[1] / force[0] - gap[2] / force[1]
    t = -(gap[0, 0] - gap[0, 1]) / (change[0] - change[1])
    borne = mixed([(1 - t / force[0] + t / force[1], free), (t / force[0], held[0]), (-t / force[1], held[1])])
    left = falsified.everywhere(borne.jump[falsified.row[alone[0]]])[0]
    forces, lengths = (
        falsified.everywhere(each) for each in (borne.lam[falsified.row], falsified.interface.nodes.length)
    )
    largest = max(np.abs(forces).max(), falsified.bond_stress(PULLED) * lengths.max())
    expected = abs(t) * left / (largest * falsified.imposed(PULLED))
    assert left > 0 and expected > 1e-4
    falsified.assert_only(falsified.checks(borne, status), kkt_complementarity=expected)


@pytest.mark.parametrize(("share", "seen"), [(1.0, 1), (1e-4, 1), (-1e-4, 2), (1e-16, 0)])
def test_faces_that_stick_beyond_their_friction(rubbing, share, seen):
    """All stick, those of the last rank in their place: by how much shear exceeds mu p, of the largest traction.

    After the load a share of its state is left, relative to the strain that was times the ratio of the bounds.
    """
    friction = np.where(rubbing.arc & (rubbing.comm.rank == rubbing.comm.size - 1), 0.05, 1e3)
    faces = SlidingCell(CoupledInterfaces(rubbing.interface), friction, 0.0 * friction)
    bonds = replace(torn_cells.bonds(rubbing.status(CLOSED)), sliding=np.zeros(len(friction), np.int8))
    load, (status, start) = Load.strain(PRESSED), faces.begin(bonds, PRESSED)
    given = Prescribed(load.by_stress, faces.given(load), np.zeros(len(status)))
    x, _ = faces.faces.linear(0 * status, given, start)
    state = faces.equilibrium([load, Load.strain((share == 1.0) * PRESSED)], bonds, share * x)
    traction = rubbing.everywhere(rubbing.interface.traction(state.solution))
    (normal, shear), mu = traction[rubbing.everywhere(rubbing.arc)].T, rubbing.everywhere(friction[rubbing.arc])
    reuss, voigt = rubbing.bounds()
    least = np.abs(share * PRESSED).max(), (reuss / voigt).min() * np.abs(PRESSED).max()
    largest = max(np.abs(traction).max(), rubbing.bond_stress(np.array(least)))
    lengths = rubbing.everywhere(rubbing.interface.nodes.length / rubbing.interface.scales.longest)
    pull = np.maximum(normal * lengths[rubbing.everywhere(rubbing.arc)], 0.0)
    beyond, tension = (np.abs(shear) - mu * np.maximum(-normal, 0.0)).max() / largest, pull.max() / largest
    for number, (law, expected) in enumerate([("kkt_friction", beyond), ("kkt_tension", tension)]):
        parallel_assert(rubbing.comm, state.certificate[law] == pytest.approx(expected, rel=1e-6, abs=1e-30), law)
        assert expected > (1e-2 if share == 1.0 else 1e-5) if number < seen else expected < 1e-14, law


def test_a_stress_that_is_not_the_prescribed_one(falsified):
    status, extra = falsified.status(BONDED), 0.01
    load = Load(np.array([4.0, -0.01, 1.0]), np.array([True, False, True]))
    solution = falsified.interface.linear(load, torn_cells.bonds(status), np.zeros(falsified.cell.solver.rows))
    other = replace(load, values=load.values + np.array([0.0, 0.0, extra]))
    stress = falsified.interface.stress(solution)
    reuss = falsified.reuss()
    roots = np.sqrt(np.diag(reuss))
    asked = np.abs(np.linalg.inv(reuss)) @ (other.by_stress * np.abs(other.values)) + [0.0, 0.01, 0.0]
    expected = extra / roots[2] / max(np.abs(stress / roots).max(), np.abs(roots * asked).max())
    falsified.assert_only(falsified.checks(solution, status, load))
    falsified.assert_only(falsified.checks(solution, status, other), stress=expected)
    assert len({found.residual for found in falsified.comm.allgather(solution)}) == 1


def test_a_stiffness_that_is_not_symmetric(falsified, monkeypatch):
    context = AnalysisContext.of(falsified.cell, Progress(falsified.comm, quiet=True))
    context = replace(context, loads=CellLoads(falsified.cell, contact=False))
    respond = context.plane.respond

    def skewed(*arguments):
        first, *others = respond(*arguments)
        return [replace(first, stress=first.stress + np.array([0.0, 1.0, 0.0])), *others]

    monkeypatch.setattr(context.plane, "respond", skewed)
    L = stiffness.run(context)["effective_stiffness"]
    assert context.checks.errors["symmetry"] == pytest.approx(1.0 / np.abs(L).max(), rel=1e-6)
    assert len(context.checks.faults) == 1 and "check symmetry" in context.checks.faults[0]


def test_noise_is_a_share_of_the_largest_force_of_all_ranks(falsified):
    solution, interface = falsified.solution(PULLED, falsified.status(BONDED)), falsified.interface
    forces = falsified.everywhere(interface.traction(solution) * interface.nodes.length[:, None])
    lengths = falsified.everywhere(interface.nodes.length)
    share = 10 * falsified.cell.solver.rtol
    caused = falsified.bond_stress(PULLED) * lengths.max()
    parallel_assert(
        falsified.comm,
        interface.scales.force_noise(solution) == pytest.approx(share * max(np.abs(forces).max(), caused), rel=1e-9),
    )
    assert interface.scales.gap_noise(PULLED) == pytest.approx(share * falsified.imposed(PULLED), rel=1e-9)


def test_a_node_that_one_rank_has_debonded_may_touch_on_all(falsified):
    status = np.where(falsified.chosen(0), OPEN, BONDED).astype(np.int8)
    parallel_assert(falsified.comm, not falsified.interface.is_linear(status))
    assert falsified.interface.is_linear(np.full(len(status), BONDED, np.int8))
