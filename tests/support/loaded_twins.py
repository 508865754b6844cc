"""Cases under mixed loads, their results, and the same cells condensed for the oracle they are checked by."""

import math

import numpy as np
from petsc4py import PETSc
from reference.condensed_cell import CondensedCell, MixedLoad
from reference.mixed_path import MixedPath, Strengths, Toughness
from reference.quadratic_programme import QuadraticProgramme, torus_keys
from reference.spatial_forms import law
from reference.spatial_programme import Part, SpatialProgramme

from feti_homog import Case, run
from feti_homog.homogenization import unit_cell
from feti_homog.mesh.arrange import arrange
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress
from support.ranks import PIECES

GENERALIZED = "generalized"
TIGHT = {"feti_ksp_rtol": 1e-12}
EPOXY_GLASS = (
    {"young": 3.45, "poisson": 0.35, "expansion": 54e-6},
    {"young": 73.0, "poisson": 0.22, "expansion": 5e-6},
)


def document(cell, phases, plane, interface=None, petsc=None, **analysis):
    """Return a case as a document.

    `phases` are tables of materials, `analysis` is one type and its section, or None.
    """
    (name,) = analysis
    circular = {} if cell.get("geometry") == "mesh" else {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3}
    sections = {key: value for key, value in (analysis | {"interface": interface}).items() if value is not None}
    return {
        "cell": circular | cell,
        "material": dict(zip(("matrix", "fibre"), phases, strict=False)),
        "analysis": {"type": name, "plane": plane},
        "petsc": TIGHT | (petsc or {}),
        "decomposition": PIECES,
        "output": {"pictures": False, "fields": False},
    } | sections


def solved(comm, folder=".", **case):
    """Return the result of a case. Collective."""
    return run(Case.parse(document(**case), folder), comm)


def loads_of(written):
    """Return the loads of a case, in full."""
    return [MixedLoad.named(target) for target in Case.parse(document(**written)).targets]


class LoadedTwin:
    """The condensed cell of a case, on rank 0.

    Attributes:
        case: what is solved.
        cell, bonded: None on other ranks.
    """

    def __init__(self, comm, **written):
        """Tear the case of these sections and assemble its twin.  Collective."""
        parsed = Case.parse(document(**written))
        self.comm, self.case, self.interface = comm, parsed, written.get("interface") or {}
        PETSc.garbage_cleanup(comm)
        with case_options(parsed.petsc):
            torn = unit_cell.tear(parsed, comm, Progress(comm, quiet=True))
        size = np.array([torn.summary.width, torn.summary.height])
        phases = dict(zip(("matrix", "fibre"), written["phases"], strict=True))
        generalized = parsed.analysis.plane == GENERALIZED
        own = [_spatial(s, *law(phases[s.submesh.phase])) if generalized else _plane(s) for s in torn.subdomains]
        nodes = torn.solver.jump_operator.nodes
        gathered, keys = comm.gather(own), comm.gather(torus_keys(nodes.points, size)[torn.debonded(None)])
        torn.destroy()
        self.cell = self.bonded = None
        if gathered is not None:
            fibres, parts = arrange(parsed.cell), [part for of_rank in gathered for part in of_rank]
            if generalized:
                programme = SpatialProgramme(parts, size, fibres.centres, fibres.radii)
            else:
                programme = QuadraticProgramme(parts, fibres.centres, fibres.radii, size)
            self.bonded = ~np.isin(programme.key, np.concatenate(keys))
            self.cell = CondensedCell(programme, self.interface.get("contact", True), self.springs)

    @property
    def loads(self):
        """Return the loads of the case, in full."""
        return [MixedLoad.named(target) for target in self.case.targets]

    @property
    def springs(self):
        """(3,) stiffnesses, or None."""
        n, t = (self.interface.get(f"{which}_stiffness") for which in ("normal", "tangential"))
        return None if n is None else (n, t, self.interface.get("axial_stiffness", t))

    @property
    def _law(self):
        given = self.interface
        if given.get("criterion") == "energy":
            mode, growth = given.get("mode_sensitivity", 0.25), given.get("growth", "released")
            return Toughness(given["toughness"], mode, growth)
        n, t = (given.get(f"{which}_strength", math.inf) for which in ("normal", "tangential"))
        return Strengths((n, t, given.get("axial_strength", t)), given.get("criterion", "max"))

    def equilibrium(self, load):
        """Return the state under a load, on every rank. Collective."""
        return on_root(self.comm, lambda: self.cell.equilibrium(load, self.bonded))

    def path(self, steps=12):
        """Return the events of the case's path, on every rank. Collective."""
        return on_root(self.comm, lambda: MixedPath(self.cell, self._law, self.bonded).follow(self.loads, steps))

    def increments(self, steps, worst_only):
        """Its states after each of so many steps, with the bonds that broke and what was lost.  Collective."""
        path = MixedPath(self.cell, self._law, self.bonded) if self.comm.rank == 0 else None
        return on_root(self.comm, lambda: path.increments(self.loads, steps, worst_only))

    def between(self, points, events):
        """(strains, stresses), (p, m), of points of a path on its later legs that `events` do not have.  Collective."""
        return on_root(self.comm, lambda: self._between(points, events))

    def _between(self, points, events):
        loads, ends = self.loads, [e.state for e in events if not e.broke.any()]
        states = []
        for point in points:
            broken = [e.broke for e in events if e.load_factor <= point.load_factor]
            bonded = self.bonded & ~np.any(broken, axis=0)
            leg = int(point.load_factor * len(loads))
            load, share = loads[leg], point.load_factor * len(loads) - leg
            start = MixedLoad(np.where(load.by_stress, ends[leg - 1].stress, ends[leg - 1].strain), load.by_stress)
            states.append(self.cell.equilibrium(start.towards(load, share), bonded))
        return np.array([s.strain for s in states]), np.array([s.stress for s in states])


def _plane(s):
    return s.mesh.points, s.mesh.triangles, s.submesh.body, int(s.submesh.phase != "matrix"), s.L, s.is_mixed


def _spatial(s, C, alpha):
    expansion = np.zeros(6) if alpha is None else alpha
    return Part(s.mesh.points, s.mesh.triangles, s.submesh.body, s.submesh.phase == "matrix", C, expansion)


def relative(found, expected):
    """Largest difference, relative to the largest number."""
    expected = np.asarray(expected)
    return float(np.abs(np.asarray(found) - expected).max() / max(np.abs(expected).max(), 1e-14))


def is_end(point, legs):
    """Return whether a leg ends at a point."""
    return any(abs(point.load_factor * legs - k) < 1e-12 for k in range(1, legs + 1))


def closed_faces(state):
    """Return the number of faces under pressure, and with faces that touch without a force."""
    force, gap = np.abs(state.force[:, 0]), np.abs(state.jump[:, 0])
    has_force = force > 1e-9 * force.max()
    touches = ~has_force & (gap <= 1e-9 * np.abs(state.jump).max())
    return int((state.closed & has_force).sum()), int((state.closed | touches).sum())


def compare_paths(comm, tolerance=1e-8, steps=12, **case):
    """Return the result of a path whose points are those of the oracle, and the events. Collective.

    The points are events with their energies, and changes of contact between them.
    """
    twin, result = LoadedTwin(comm, **case), solved(comm, **case)
    events, legs = twin.path(steps), len(twin.loads)
    points = [p for p in result.path if p.broke or is_end(p, legs)]
    assert [p.broke for p in points] == [int(e.broke.sum()) for e in events]
    states, m = [e.state for e in events], len(points[0].strain)
    pairs = {
        "load_factor": [e.load_factor for e in events],
        "strain": [s.strain[:m] for s in states],
        "stress": [s.stress[:m] for s in states],
        "stored": [s.stored for s in states],
        "stored_in_springs": [s.in_springs for s in states],
        "dissipated": [e.dissipated for e in events],
        "dissipated_strain_controlled": [e.dissipated_at_rising_load for e in events],
        "work": [s.stored + e.dissipated for s, e in zip(states, events, strict=True)],
    }
    if points[0].temperature is not None:
        pairs["temperature"] = [s.strain[m] for s in states]
    for name, expected in pairs.items():
        error = relative([getattr(p, name) for p in points], expected)
        assert error < tolerance, f"{name}: {error:.1e}"
    # Where nothing is stored faces touch without a force.
    most = max(s.stored for s in states)
    loaded = [(p.closed, *closed_faces(s)) for p, s in zip(points, states, strict=True) if s.stored > 1e-9 * most]
    assert all(least <= found <= most for found, least, most in loaded), loaded
    between = [p for p in result.path if not (p.broke or is_end(p, legs))]
    if between:
        for name, expected in zip(("strain", "stress"), twin.between(between, events), strict=True):
            largest = np.abs([getattr(p, name) for p in result.path]).max()
            off = np.abs(np.array([getattr(p, name) for p in between]) - expected[:, :m]).max()
            assert off < tolerance * largest, f"{name} between events: {off / largest:.1e}"
    assert result.status == "done"
    return result, events
