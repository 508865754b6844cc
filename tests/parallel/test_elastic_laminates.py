"""Strips on springs, exact in closed form: stiffness, and a path that breaks all bonds at once.

1 / C11 = <1 / M> + 2 / (k_n W), M = lambda + 2 mu, and 1 / C33 = <1 / mu> + 2 / (k_t W) for a strip normal to x1 in a
cell of width W; under E11 the stress rises in a straight line to sqrt(2 k_n G_Ic), and is none from there on.
"""

import numpy as np
import pytest
from reference.closed_forms import lame
from support import torn_cells
from support.cases import FIBRE, MATRIX, case_of
from support.load_paths import beginning, followed
from support.ranks import write_once
from unit.mesh.faulty_meshes import grid

from feti_homog import run
from feti_homog.homogenization.averaging import Homogenization
from feti_homog.interface.laws.energy import ReleasedEnergy, SpringEnergy

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

NORMAL, TANGENTIAL, TOUGHNESS = 700.0, 150.0, 0.02
FRACTION = 0.25


@pytest.fixture
def strip(comm, shared_path):
    """Provide a cell with a strip of fibre normal to x1, a quarter of it, at either order."""
    write_once(comm, grid(lambda x, y: 0.25 < x < 0.5), shared_path / "strip.msh")
    petsc = {"feti_pc_type": "influence"}
    strip = {"geometry": "mesh", "file": "strip.msh", "folder": shared_path, "petsc": petsc}
    cells = [torn_cells.tear(comm, **strip, order=order, springs=(NORMAL, TANGENTIAL)) for order in (1, 2)]
    yield cells
    for cell in cells:
        cell.solver.destroy()


def series(matrix, fibre, stiffness):
    """Return the modulus of matrix, fibre and two interfaces of a cell of width 1 in a row."""
    return 1.0 / ((1 - FRACTION) / matrix + FRACTION / fibre + 2.0 / stiffness)


def moduli():
    """C11 and C33 in closed form."""
    (la_m, mu_m), (la_f, mu_f) = (lame(phase) for phase in (MATRIX, FIBRE))
    return series(la_m + 2 * mu_m, la_f + 2 * mu_f, NORMAL), series(mu_m, mu_f, TANGENTIAL)


def test_the_stiffness_is_exact(strip):
    for cell in strip:
        homogenization, starts = Homogenization(cell, True), [np.zeros(cell.solver.rows)] * 3
        bonds = beginning(homogenization.interface).bonds
        L = np.array([r.stress for r in homogenization.respond(np.eye(3), bonds, starts)]).T
        C11, C33 = moduli()
        assert L[0, 0] == pytest.approx(C11, rel=1e-9) and L[2, 2] == pytest.approx(C33, rel=1e-9)


@pytest.mark.parametrize("growth", ["released", "springs"])
def test_all_bonds_break_at_once_and_nothing_is_left(comm, strip, growth):
    C11, peak = moduli()[0], np.sqrt(2 * NORMAL * TOUGHNESS)
    for cell in strip:
        interface = torn_cells.interface(cell, True)
        springs = SpringEnergy(NORMAL, TANGENTIAL, TOUGHNESS, 0.25)
        law = springs if growth == "springs" else ReleasedEnergy(**vars(springs), influence=cell.solver.exact_inverse)
        strain = np.array([[2 * peak / C11, 0.0, 0.0]])
        first, last = followed(interface, law, strain)
        assert first.load_factor == pytest.approx(0.5, rel=1e-8)
        assert first.scale * interface.stress(first.state.solution)[0] == pytest.approx(peak, rel=1e-8)
        assert first.broke == comm.allreduce(len(interface.nodes.row))
        assert last.load_factor == 1.0 and abs(interface.stress(last.state.solution)[0]) < 1e-9 * peak
        # All that was stored is lost.
        assert last.energies.released == pytest.approx(0.5 * 0.5 * strain[0, 0] * peak, rel=1e-8)


@pytest.mark.parametrize("axial", [None, 40.0, np.inf], ids=["default", "given", "rigid"])
def test_springs_along_the_fibres_are_those_around_them_by_default(comm, strip, shared_path, axial):
    """1 / C55 = <1 / mu> + 2 / (k_a W) and 1 / C66 with k_t, of axial shear across the layers and in the plane."""
    springs = {"normal_stiffness": NORMAL, "tangential_stiffness": TANGENTIAL}
    springs |= {} if axial is None else {"axial_stiffness": axial}
    cell = {"geometry": "mesh", "file": "strip.msh", "order": 1}
    case = case_of(cell, shared_path, "generalized", interface=springs, output={"mesh_error": False})
    found = run(case, comm).effective_stiffness
    matrix, fibre = lame(MATRIX)[1], lame(FIBRE)[1]
    shears = [series(matrix, fibre, k) for k in (TANGENTIAL if axial is None else axial, TANGENTIAL)]
    assert [found[4, 4], found[5, 5]] == pytest.approx(shears, rel=1e-7)
