"""The mesh of a case in another format, and its material on cards."""

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import gmsh
import meshio
import numpy as np
from support.card_readers import READERS
from support.effective_results import COSINES, PAIRS, turned_stiffness
from support.other_formats import written
from unit.mesh.faulty_meshes import MshFile

from differential.comparison import DIFFERENT
from differential.finer_meshes import FORMATS, NUMBERS
from differential.random_cells import MESH
from differential.setting import Compared, Setting
from feti_homog.report.cards.effective_material import COUPLINGS, NEGLIGIBLE, in_axes_of_the_cell
from feti_homog.report.cards.export import FORMATS as CARDS
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.typing import Float


def mesh_format(setting: Setting) -> Compared:
    """Read the user's mesh from a file of Abaqus, gmsh, VTK or Medit.  Collective."""
    suffix, binary = str(setting.rng.choice(FORMATS)), bool(setting.rng.random() < 0.5)
    path = setting.work / f"other{suffix}"
    on_root(setting.comm, _rewrite, setting.drawn.folder / MESH, path, binary)
    numbers = {"phases": NUMBERS} if suffix == ".mesh" else {}
    cell = setting.drawn.document["cell"] | {"file": str(path)} | numbers
    return setting.compared(setting.solved(setting.drawn.document | {"cell": cell}))


def _rewrite(source: Path, path: Path, binary: bool) -> None:
    if path.suffix == ".msh":
        gmsh.initialize(interruptible=False)
        try:
            for name, value in {"General.Terminal": 0, "Mesh.MshFileVersion": 4.1, "Mesh.Binary": binary}.items():
                gmsh.option.setNumber(name, value)
            gmsh.open(str(source))
            gmsh.write(str(path))
        finally:
            gmsh.finalize()
        return
    with redirect_stdout(io.StringIO()):
        mesh = meshio.read(source)
    nodes = {tag: tuple(point) for tag, point in enumerate(mesh.points.tolist(), start=1)}
    rows = zip(mesh.cells_dict["triangle"], mesh.cell_data_dict["gmsh:physical"]["triangle"], strict=True)
    elements = {tag: (2, int(p), int(p), tuple((1 + own).tolist())) for tag, (own, p) in enumerate(rows, start=1)}
    names = {int(number): name for name, (number, _) in mesh.field_data.items()}
    of_vtk = {"binary": binary} if path.suffix in (".vtk", ".vtu") else {}
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        written(MshFile(nodes, elements, names), path, **of_vtk)


def card(setting: Setting) -> Compared:
    """Read the material of a card back: stiffness and expansion of the cell, turned to the axes of the card."""
    form = str(setting.rng.choice([*CARDS]))
    C, alpha = READERS[form](CARDS[form](in_axes_of_the_cell(setting.base)))
    stiffness = turned_stiffness(np.array(setting.base["effective_stiffness"]), COSINES.T)
    expansion = setting.base.get("thermal_expansion")
    if (alpha is None) != (expansion is None):
        return Compared(DIFFERENT, f"the expansion of a card for {form}")
    tensor = np.zeros((3, 3))
    for (i, j), value in zip(PAIRS, [0.0] * 6 if expansion is None else expansion, strict=True):
        tensor[i, j] = tensor[j, i] = value if i == j else value / 2
    tensor, largest = COSINES.T @ tensor @ COSINES, np.abs(tensor).max() or 1.0
    expected = np.linalg.inv(stiffness)
    if max(_couplings(stiffness).max(), 2 * np.abs(tensor - np.diag(np.diag(tensor))).max() / largest) <= NEGLIGIBLE:
        expected, tensor = np.where(COUPLINGS, 0.0, expected), np.diag(np.diag(tensor))
    compliance = np.linalg.inv(np.array([[C[*row, *column] for column in PAIRS] for row in PAIRS]))
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    off = 0.0 if alpha is None else float(np.abs(alpha - tensor).max() / largest)
    return Compared(max(float(np.abs((compliance - expected) / size).max()), off), f"card for {form}")


def _couplings(C: Float) -> Float:
    """Return |C_ij| / sqrt(C_ii C_jj) of the entries that orthotropic materials lack."""
    return np.abs(C / np.sqrt(np.outer(np.diag(C), np.diag(C))))[COUPLINGS]
