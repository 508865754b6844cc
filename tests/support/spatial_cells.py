"""Cases of generalized plane strain, their results, and the same cells for the sparse system they are checked by."""

import numpy as np
from petsc4py import PETSc
from reference.quadratic_programme import torus_keys
from reference.spatial_forms import law
from reference.spatial_programme import Part, SpatialProgramme

from feti_homog.analysis.runner import compute
from feti_homog.case.cases import Case
from feti_homog.homogenization import unit_cell
from feti_homog.mesh.arrange import arrange
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

EPOXY = {"young": 3.45, "poisson": 0.35, "expansion": 54.0}
GLASS = {"young": 73.0, "poisson": 0.22, "expansion": 5.0}


def document(matrix=EPOXY, fibre=GLASS, petsc=None, analysis="stiffness", sections=None, **cell):
    """Return a case as a document; `cell` are keys of its cell, `sections` more of its sections."""
    circular = {} if cell.get("geometry") == "mesh" else {"fibre_fraction": 0.4, "mesh_size": 0.2}
    return {
        "cell": {"geometry": "square"} | circular | cell,
        "material": {"matrix": matrix, "fibre": fibre},
        "analysis": {"type": analysis, "plane": "generalized"},
        "petsc": {"feti_ksp_rtol": 1e-12} | (petsc or {}),
    } | (sections or {})


def solved(comm, folder=".", **case):
    """Return the result of a case. Collective."""
    return compute(Case.parse(document(**case), folder), comm)


class Twin:
    """The sparse system of a case, on rank 0.

    Attributes:
        programme: None on other ranks.
    """

    def __init__(self, comm, folder=".", **case):
        """Tear the case and assemble its twin.  Collective."""
        written = document(**case)
        parsed = Case.parse(written, folder)
        self.comm = comm
        with case_options(parsed.petsc):
            self.cell = unit_cell.tear(parsed, comm, Progress(comm, quiet=True))
        phases = {name: law(material) for name, material in written["material"].items()}
        parts = comm.gather(
            [
                Part(s.mesh.points, s.mesh.triangles, s.submesh.body, s.submesh.phase == "matrix", C, _expansion(alpha))
                for s in self.cell.subdomains
                for C, alpha in (phases[s.submesh.phase],)
            ]
        )
        size, self.programme = np.array([self.cell.summary.width, self.cell.summary.height]), None
        if parts is not None:
            fibres = None if parsed.cell.geometry == "mesh" else arrange(parsed.cell)
            circles = () if fibres is None else (fibres.centres, fibres.radii)
            self.programme = SpatialProgramme([part for own in parts for part in own], size, *circles)

    def bonded(self, opening=None):
        """(k,) of the programme's interface nodes on rank 0: all but those that are debonded from the start."""
        nodes = self.cell.solver.jump_operator.nodes
        size = np.array([self.cell.summary.width, self.cell.summary.height])
        open_keys = self.comm.gather(torus_keys(nodes.points, size)[self.cell.debonded(opening)])
        return None if open_keys is None else ~np.isin(self.programme.key, np.concatenate(open_keys))

    def secants(self, opening=None, **how):
        """Stiffness (6, 6) and thermal stress (6,) of `SpatialProgramme.secants`, on every rank.  Collective."""
        bonded = self.bonded(opening)
        S = self.comm.bcast(self.programme and self.programme.secants(bonded=bonded, **how))
        return S[:6, :6], S[:6, 6]

    def destroy(self):
        """Free the cell.  Collective."""
        self.cell.destroy()
        PETSc.garbage_cleanup(self.comm)


def _expansion(alpha):
    return np.zeros(6) if alpha is None else alpha


def error(found, expected):
    """Largest difference of entries.

    It is, of a stiffness, relative to the root of the product of its diagonal entries, else to the largest entry, or to
    1e-9 where there is none, of moduli about 1.
    """
    difference, expected = np.abs(found - expected), np.asarray(expected)
    if expected.ndim == 2:
        size = np.sqrt(expected.diagonal())
        return float((difference / np.outer(size, size)).max())
    return float(difference.max() / max(np.abs(expected).max(), 1e-9))
