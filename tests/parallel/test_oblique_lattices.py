"""Lattices that are not rectangular, as rectangular cells of several fibres."""

import numpy as np
import pytest
from mpi4py import MPI
from support.base_case import BASE

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]
CELL = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05\n'
FINE = "mesh_size = 0.12\nrefine = 1\norder = 2\n"


def stiffness(tmp_path, cell):
    path = tmp_path / f"case{MPI.COMM_WORLD.rank}.toml"
    path.write_text(BASE.replace(CELL, f"{cell}{FINE}"))
    return run(Case.load(path), MPI.COMM_WORLD).effective_stiffness


def lattice(w, s, h, q, radius):
    """Return the cell of q fibres that `Lattices that are not rectangular` of meshes/README.md describes."""
    centres = [(k * s % w, k * h) for k in range(q)]
    fibres = ", ".join(f"{{x = {x}, y = {y}, radius = {radius}}}" for x, y in centres)
    return f'geometry = "table"\nwidth = {w}\nheight = {q * h}\nfibre_list = [{fibres}]\n'


def turned_by_45_degrees(c):
    """Q C Q^T for the stresses [11, 22, 12] along the axes (1, 1) and (-1, 1)."""
    q = np.array([[0.5, 0.5, 1.0], [0.5, 0.5, -1.0], [-0.5, 0.5, 0.0]])
    return q @ c @ q.T


def test_square_lattice_along_its_diagonal_has_the_turned_stiffness(tmp_path):
    """The vectors (1, 1) and (0, 1) of the square lattice, turned: w = sqrt(2), s = h = w / 2."""
    radius = float(np.sqrt(0.4 / np.pi))
    w = float(np.sqrt(2))
    found = stiffness(tmp_path, lattice(w, w / 2, w / 2, 2, radius))
    expected = turned_by_45_degrees(stiffness(tmp_path, 'geometry = "square"\nfibre_fraction = 0.4\n'))
    assert found == pytest.approx(expected, abs=1e-5 * expected.max())
