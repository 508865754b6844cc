"""Numbers of fibres in the picture of a window without periodic images: each inside its own fibre."""

import h5py
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree
from support.unmatched_meshes import write_discs

from feti_homog import Case, run
from feti_homog.report.plots import cell_picture, drawn_cell, plot_helpers


def test_a_fibre_that_a_side_cuts_has_its_number_on_this_side_alone(tmp_path):
    """Its image beyond the other side would be in the matrix."""
    write_discs(tmp_path / "cell.msh", np.array([[0.05, 0.5], [0.55, 0.45]]), 0.2)
    case = {
        "cell": {"geometry": "mesh", "file": str(tmp_path / "cell.msh"), "boundary": "displacement"},
        "material": {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.2}},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "output": {"pictures": False},
    }
    run(Case.parse(case), MPI.COMM_SELF, out=tmp_path / "out")
    with h5py.File(tmp_path / "out/result.h5") as file:
        bodies = dict(zip(map(str, file["fibre/number"][:]), file["fibre/body"][:], strict=True))
        elements = cKDTree(file["mesh/points"][:][file["mesh/triangles"][:, :3]].mean(axis=1))
        axes, *_ = cell_picture.figure(drawn_cell.DrawnCell.of(file), plot_helpers.PLAIN).axes
        numbers = {text.get_text(): elements.query(text.get_position())[1] for text in axes.texts}
        assert len(axes.texts) == 2
        assert {name: file["mesh/body"][element] for name, element in numbers.items()} == bodies
