"""A case's result: Python object, result.json content, and fields in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from feti_homog.analysis import cell_records, result_records
from feti_homog.materials import engineering_constants, phase_bounds, voigt
from feti_homog.results import field_layout, result_json
from feti_homog.system.runtime import described, records
from feti_homog.typing import Float

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


Part = TypeVar(
    "Part", field_layout.MeshPart, field_layout.FibrePart, field_layout.InterfacePart, field_layout.StatePart
)


@dataclass(frozen=True, repr=False)
class Fields:
    """This rank's part in the fields; `gathered` has all parts.

    Attributes:
        header: cell size, phases, units.
        mesh: points (n, 2), triangles (m, 3 or 6), their bodies and phases; nodes are torn between subdomains.
        fibres: number as in case files (f,), body, phase, centre (f, 2) and radius (f,), on rank 0.
        interface: points (k, 2), normal (k, 2), length (k,) and fibre (k,) at the fibre-matrix interface nodes, and the
            numbers that their nodes have in the gathered mesh.
        states: for each load case, or point on an angle or path: displacement (n, 2), stress (m, 3), traction, jump
            (k, 2) and status (k,), with strain, mean stress, load factor and label.
    """

    comm: Intracomm
    header: field_layout.Header
    mesh: field_layout.MeshPart
    fibres: field_layout.FibrePart
    interface: field_layout.InterfacePart
    states: tuple[field_layout.StatePart, ...]

    def __repr__(self) -> str:
        return f"Fields({len(self.mesh.points)} nodes, {len(self.mesh.triangles)} elements, {len(self.states)} states)"

    def gathered(self) -> Fields | None:
        """Gather all fields as one part on rank 0, else None.  Collective."""
        first = self.comm.exscan(len(self.mesh.points)) or 0
        mesh = _gathered(self.comm, replace(self.mesh, triangles=self.mesh.triangles + np.int64(first)))
        fibres, interface = _gathered(self.comm, self.fibres), _gathered(self.comm, self.interface)
        states = [_gathered(self.comm, state) for state in self.states]
        if mesh is None or fibres is None or interface is None:
            return None
        rows = tuple(state for state in states if state is not None)
        return Fields(self.comm, self.header, mesh, fibres, interface, rows)


def _gathered(comm: Intracomm, part: Part) -> Part | None:
    """Gather all ranks' rows, in rank order, on rank 0."""
    parts = {name: comm.gather(getattr(part, name)) for name in field_layout.tables(part)}
    if comm.rank:
        return None
    joined: dict[str, Any] = {name: np.concatenate(rows or []) for name, rows in parts.items()}
    return replace(part, **joined)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)  # arrays have no single answer to "equal"
class Result:
    """Result of a case, alike on all ranks except for `fields`.

    Printed, it is a short summary; in a notebook, tables.  The manual lists all written keys.

    Attributes:
        effective_stiffness: (3, 3), in generalized plane strain (6, 6), L^ef, with stresses under the unit strains as
            columns; for analysis "stiffness".
        effective_stiffness_compression: L^ef under minus the unit strains, if debonded faces touch without tension.
        compliance, thermal_stress, thermal_expansion: in generalized plane strain, (6, 6) and (6,), else None.
        moduli, bounds: for perfectly bonded cells, else None.
        mesh_error: estimated mesh errors in a stiffness and its constants, unless the case forgoes them.
        sensitivities: derivatives of a stiffness by the case's constants, if it asks for them, else None.
        tips: energy release rates for a stiffness with debonded arcs, else None; angle points have their own.
        angle, path, envelope: these analyses' points, else None; `points` has angles and paths as arrays.
        fields: mesh, interface and states on this rank if they were asked for, else None; not written to result.json.
    """

    schema: int = described("version of this layout", default=result_json.SCHEMA)
    version: str = described("version of the program")
    case: Mapping[str, Any] = described("the case with its defaults, as in a case file", entries={"KEY": "as there"})
    digest: str = described("short digest of the case without its name, labels, pictures and PETSc options")
    cell: cell_records.CellInfo = described("the meshed cell")
    fibres: tuple[cell_records.FibreInfo, ...] = described("the fibres in the order of their numbers", default=())
    solver: cell_records.SolverInfo = described("how the dual problem was solved")
    checks: cell_records.Checks = described("largest relative error of each law over all states")
    check_tolerance: float = described("largest error of a check that passes")
    kkt_tolerance: float = described("the same of the checks of contact")
    warnings: tuple[str, ...] = described("settings that are valid but probably unintended")
    remarks: tuple[str, ...] = described("assumptions about settings that the case does not give", default=())
    faults: tuple[str, ...] = described("solves that did not converge and checks that failed")
    status: str = described("`done`, or `not converged` if there are faults")
    moduli: engineering_constants.Moduli | None = described(
        "engineering moduli of a perfectly bonded cell", default=None
    )
    bounds: cell_records.StiffnessBounds | None = described("bounds of a perfectly bonded cell", default=None)
    effective_stiffness: Float | None = described(
        "L^ef: columns are the stresses under the unit strains",
        records.STRESS,
        result_records.EITHER_STIFFNESS,
        default=None,
    )
    effective_stiffness_compression: Float | None = described(
        "the same under minus the unit strains, with contact",
        records.STRESS,
        result_records.EITHER_STIFFNESS,
        default=None,
    )
    compliance: Float | None = described(
        "of generalized plane strain: inverse of L^ef", f"1 / {records.STRESS}", "(6, 6)", default=None
    )
    thermal_stress: Float | None = described(
        "stress per unit of temperature at zero strain, if the phases have expansions",
        f"{records.STRESS} per unit of temperature",
        "(6,)",
        default=None,
    )
    thermal_stress_compression: Float | None = described(
        "minus the stress under minus a unit of temperature, with contact",
        f"{records.STRESS} per unit of temperature",
        "(6,)",
        default=None,
    )
    thermal_expansion: Float | None = described(
        "strains under a unit of temperature at no stress, without contact", "1 / temperature", "(6,)", default=None
    )
    constants: engineering_constants.EngineeringConstants | None = described(
        "of generalized plane strain: constants in the axes of the cell", default=None
    )
    transversely_isotropic: engineering_constants.TransverseIsotropy | None = described(
        "constants of the nearest transversely isotropic stiffness about x3", default=None
    )
    transverse_moduli: engineering_constants.TransverseModuli | None = described(
        "ranges of Young's and shear moduli across the fibres", default=None
    )
    estimates: phase_bounds.Estimates | None = described(
        "closed estimates of the same, of a cell without debonding", default=None
    )
    fibre_bounds: phase_bounds.FibreBounds | None = described("bounds of the same, of rigid bonds", default=None)
    mesh_error: result_records.MeshErrors | None = described(
        "estimated errors of a stiffness by its mesh", default=None
    )
    sensitivities: cell_records.Sensitivities | None = described(
        "derivatives of a stiffness, if the case asks for them", default=None
    )
    tips: result_records.TipRates | None = described(
        "energy release rates at the tips of debonded arcs, of a stiffness", default=None
    )
    angle: tuple[result_records.AnglePoint, ...] | None = described(
        "points of analysis `angle`, as in angle.csv", default=None
    )
    path: tuple[result_records.PathPoint, ...] | None = described(
        "points of analysis `path`, as in path.csv", default=None
    )
    peak: result_records.Peak | None = described("peak of the path, with its first break", default=None)
    load: result_records.LoadPoint | None = described("state of analysis `load`, as in load.csv", default=None)
    envelope: tuple[result_records.EnvelopePoint, ...] | None = described(
        "directions of analysis `envelope`, as in envelope.csv",
        default=None,
    )
    states: tuple[int, ...] | None = described(
        "of a path: the numbers, from 0, of the points whose fields are kept; /state/K is that of entry K", default=None
    )
    resumed: int | None = described("points of a path that were taken from a checkpoint", default=None)
    result_h5: result_json.FileSeal | None = described(
        "size and checksum of result.h5, if the run wrote it", default=None
    )
    timings: Mapping[str, float] = described(
        "wall time of each stage, the largest over ranks",
        records.SECONDS,
        entries={"STAGE": "of mesh, assemble, factor, ..."},
    )
    memory: int = described("peak resident memory, the largest over ranks", records.BYTES)
    checksum: str | None = described(
        "of result.json: CRC-32, in hexadecimal, of its text without this key; checked and taken away when it is read",
        default=None,
    )
    fields: Fields | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Result:
        """Build the result from result.json content; KeyError for missing keys."""
        return records.restored(cls, document)

    @property
    def document(self) -> dict[str, Any]:
        """Return the result.json content, in its order; arrays are NumPy's."""
        document: dict[str, Any] = records.plain(self)
        return document

    @property
    def points(self) -> dict[str, NDArray[Any]]:
        """Return arrays over n angle or path points by name, empty for other analyses.

        `angle` or `load_factor` (n,), `strain` and `stress` (n, 3) or (n, 6), `stiffness` (n, 3, 3) or (n, 6, 6),
        `debonded_length` (n, f), `bonded`, `open`, `closed`, ... (n,); NaN where a point has no such number; no tips.
        """
        documents = [records.plain(point) for point in (*(self.angle or ()), *(self.path or ()))]
        names = dict.fromkeys(name for point in documents for name in point if name != "tips")
        return {name: np.array([point.get(name, np.nan) for point in documents]) for name in names}

    def rising_strain(self) -> dict[str, Float]:
        """Return corners (v,) for the leading strain, first, and all stresses, by name, on a one-leg path.

        In a test with rising load the stress drops where bonds break, or under a given stress the strain jumps, to the
        next branch that holds.

        Raises ValueError for any other result, and if the strain does not rise with the load.
        """
        from feti_homog.results import path_curves  # of no use to other analyses

        curve = path_curves.rising_strain(self.document)
        if curve is None or self.peak is None:
            raise ValueError("only a path of one leg whose leading strain rises has a response to a rising strain")
        sign = np.sign((self.path or ())[-1].strain[path_curves.leading_component(self.document)])
        names = (*voigt.voigt_names(curve.shape[1] - 1)[1], self.peak.strain_name)
        columns = dict(zip(names, (curve * [*[1.0] * (len(names) - 1), sign]).T, strict=True))
        return {self.peak.strain_name: columns.pop(self.peak.strain_name)} | columns

    def path_scaled(self, *, toughness: float) -> Result:
        """Scale a path's result to another first interface toughness and s times the loads.

        s = sqrt(toughness / case toughness), alike for all interfaces.  Strains and stresses are s times,
        energies s^2 times as large, at equal events and load factors: bonds break by energy on springs with given
        stiffness.  Fields, states and digest belong to no run, and are left out.

        Raises ValueError for any other result, and for a toughness that is not positive.
        """
        from feti_homog.analysis import path_scaling  # of paths by energy alone

        case, path, peak = path_scaling.scaled(self.document, self.path or (), self.peak, toughness)
        changed = replace(self, case=case, digest="", path=path, peak=peak)
        return replace(changed, states=None, result_h5=None, fields=None)

    def first_drop(self) -> tuple[Float, int]:
        """Return the stress (3,) or (6,) after a one-leg path's first break, under the breaking load.

        Under the breaking load; also returns the point's number on its branch.  Raises ValueError for any other result.
        """
        from feti_homog.results import path_curves

        document = self.document
        if not self.path or not path_curves.is_proportional(document):
            raise ValueError("only a path of one leg, followed by events, has a first drop")
        return path_curves.first_drop(document["path"])

    def __repr__(self) -> str:
        return f"Result({self.case.get('name', '')!r}, {self.case['analysis']['type']}, {self.status})"

    # Most runs print neither: the tables are imported by those that do.
    def __str__(self) -> str:
        from feti_homog.report.text import summary

        return summary.short_summary(self.document)

    def _repr_html_(self) -> str:
        from feti_homog.report.text import summary  # notebooks alone show it

        return summary.notebook(self.document)
