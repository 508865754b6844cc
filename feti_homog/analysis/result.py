"""Represent the result of a case as a Python object: the content of result.json, and fields in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from feti_homog.analysis import cell_records, result_records
from feti_homog.materials import engineering_constants, phase_bounds, voigt
from feti_homog.results import field_layout, result_json
from feti_homog.schema import wording
from feti_homog.system.runtime import described, records
from feti_homog.typing import Float, Intracomm

CONSTANTS = ("moduli", "constants", "transversely_isotropic", "transverse_moduli")
Part = TypeVar(
    "Part", field_layout.MeshPart, field_layout.FibrePart, field_layout.InterfacePart, field_layout.StatePart
)


@dataclass(frozen=True, repr=False)
class Fields:
    """This rank's part of the fields of a result; `gathered` joins the parts of all ranks.

    Attributes:
        header: cell size, phases, units.
        mesh: points (n, 2), triangles (m, 3 or 6), their bodies and phases; nodes are torn between subdomains.
        fibres: number as in case files (f,), body, phase, centre (f, 2) and radius (f,), on rank 0.
        interface: points (k, 2), normal (k, 2), length (k,) and fibre (k,) at the fibre-matrix interface nodes, and the
            numbers of these nodes in the gathered mesh.
        states: for each load, angle or kept path point: displacement (n, 2), stress (m, 3), traction and jump (k, 2),
            status (k,), with strain, mean stress, load factor and label.
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
        """Join the parts of all ranks on rank 0.  Returns None on other ranks.  Collective."""
        first = self.comm.exscan(len(self.mesh.points)) or 0
        mesh = _gathered(self.comm, replace(self.mesh, triangles=self.mesh.triangles + np.int64(first)))
        fibres, interface = _gathered(self.comm, self.fibres), _gathered(self.comm, self.interface)
        states = tuple(_gathered(self.comm, state) for state in self.states)
        return None if self.comm.rank else Fields(self.comm, self.header, mesh, fibres, interface, states)


def _gathered(comm: Intracomm, part: Part) -> Part:
    """Gather the tables of a part on rank 0, row by row in rank order; other ranks keep their rows.  Collective."""
    tables = {name: getattr(part, name) for name in field_layout.tables(part)}
    joined: dict[str, Any] = {name: np.concatenate(comm.gather(rows) or [rows]) for name, rows in tables.items()}
    return replace(part, **joined)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)  # arrays have no single answer to "equal"
class Result:
    """The result of a case, equal on all ranks except for `fields`.

    `print` shows a short summary, a notebook shows tables.  The manual lists all keys of result.json; entries that the
    analysis does not compute are None.  Constants are attributes, too: `result.E1` comes from `moduli` or `constants`.
    `fields` has the mesh, interface and states on this rank, or None unless the run keeps fields; result.json lacks it.
    """

    schema: int = described("version of this layout", default=result_json.SCHEMA)
    version: str = described("version of the program")
    date: str = described("time at which the run ended", default="")
    case: Mapping[str, Any] = described("the case with its defaults, as in a case file", entries={"KEY": "as there"})
    digest: str = described("short digest of the case without its name, labels, pictures and PETSc options")
    cell: cell_records.CellInfo = described("the meshed cell")
    fibres: tuple[cell_records.FibreInfo, ...] = described("the fibres in the order of their numbers", default=())
    solver: cell_records.SolverInfo = described("how the dual problem was solved")
    checks: cell_records.Checks = described("largest relative error of each law over all states")
    check_tolerance: float = described("largest error of a check that passes")
    kkt_tolerance: float = described("largest error of a contact check that passes")
    warnings: tuple[str, ...] = described("settings that are valid but probably unintended")
    remarks: tuple[str, ...] = described("assumptions about settings that the case does not give", default=())
    faults: tuple[str, ...] = described("solves that did not converge, checks that failed, fields that are missing")
    status: str = described("`done`, `not converged`, or `incomplete` if fields could not be written")
    moduli: engineering_constants.Moduli | None = described("engineering moduli of a bonded cell", default=None)
    bounds: cell_records.StiffnessBounds | None = described("bounds of a perfectly bonded cell", default=None)
    effective_stiffness: Float | None = described(
        "L^ef: columns are stresses under unit strains", records.STRESS, result_records.EITHER_STIFFNESS, default=None
    )
    effective_stiffness_compression: Float | None = described(
        "the same under minus the strains, with contact", records.STRESS, result_records.EITHER_STIFFNESS, default=None
    )
    effective_conductivity: Float | None = described(
        "k^ef in the axes x1, x2, x3: columns are minus the mean fluxes under unit gradients of the temperature",
        result_records.CONDUCTIVITY,
        "(3, 3)",
        default=None,
    )
    compliance: Float | None = described(
        "inverse of L^ef, in generalized plane strain", f"1 / {records.STRESS}", "(6, 6)", default=None
    )
    thermal_stress: Float | None = described(
        "stress under a unit of temperature, if the phases expand", result_records.PER_DEGREE, "(6,)", default=None
    )
    thermal_stress_compression: Float | None = described(
        "minus the stress under minus one degree, with contact", result_records.PER_DEGREE, "(6,)", default=None
    )
    thermal_expansion: Float | None = described(
        "strains under a unit of temperature at no stress, without contact", "1 / temperature", "(6,)", default=None
    )
    constants: engineering_constants.EngineeringConstants | None = described(
        "engineering constants in the axes of the cell, in generalized plane strain", default=None
    )
    transversely_isotropic: engineering_constants.TransverseIsotropy | None = described(
        "constants of the nearest transversely isotropic stiffness about x3", default=None
    )
    transverse_moduli: engineering_constants.TransverseModuli | None = described(
        "ranges of Young's and shear moduli across the fibres", default=None
    )
    estimates: phase_bounds.Estimates | None = described("closed-form estimates, without debonding", default=None)
    fibre_bounds: phase_bounds.FibreBounds | None = described("bounds on the same, for rigid bonds", default=None)
    conductivity_estimates: phase_bounds.ConductivityEstimates | None = described(
        "closed forms of a conductivity, without debonding and voids", default=None
    )
    mesh_error: result_records.MeshErrors | None = described("estimated mesh errors of a stiffness", default=None)
    sensitivities: cell_records.Sensitivities | None = described("derivatives of the results, on request", default=None)
    tips: result_records.TipRates | None = described("energy release rates at tips of debonded arcs", default=None)
    angle: tuple[result_records.AnglePoint, ...] | None = described("points of `angle`, as in angle.csv", default=None)
    path: tuple[result_records.PathPoint, ...] | None = described("points of `path`, as in path.csv", default=None)
    peak: result_records.Peak | None = described("peak of the path, with its first break", default=None)
    load: result_records.LoadPoint | None = described("state of analysis `load`, as in load.csv", default=None)
    envelope: tuple[result_records.EnvelopePoint, ...] | None = described(
        "directions of analysis `envelope`, as in envelope.csv", default=None
    )
    states: tuple[int, ...] | None = described(
        "numbers, from 0, of the path points whose fields are kept; entry K belongs to /state/K", default=None
    )
    phase_stresses: tuple[cell_records.PhaseStresses, ...] | None = described(
        "largest stresses of each phase in each state with fields; also without fields if a phase has a strength",
        default=None,
    )
    resumed: int | None = described("points of a path that were taken from a checkpoint", default=None)
    result_h5: result_json.FileSeal | None = described("size and checksum of result.h5, if written", default=None)
    timings: Mapping[str, float] = described(
        "wall time of each stage, the largest over ranks",
        records.SECONDS,
        entries={"STAGE": "of mesh, assemble, factor, ..."},
    )
    memory: int = described("peak resident memory, the largest over ranks", records.BYTES)
    checksum: str | None = described(
        "CRC-32, in hexadecimal, of the text of result.json without this key; checked and removed by a reader",
        default=None,
    )
    fields: Fields | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Result:
        """Restore a result from the content of result.json.  Raises KeyError, TypeError or ValueError if faulty."""
        return records.restored(cls, document)

    @property
    def document(self) -> dict[str, Any]:
        """Return the content of result.json in the order of the file, with NumPy arrays."""
        return dict(records.plain(self))

    @property
    def points(self) -> dict[str, NDArray[Any]]:
        """The values at n angle or path points, as arrays by name; {} for other analyses.

        `angle` or `load_factor` (n,), `strain` and `stress` (n, 3) or (n, 6), `stiffness` (n, 3, 3) or (n, 6, 6),
        `debonded_length` (n, f) of f fibres, `bonded`, `open`, `closed`, ... (n,), without tips; NaN where a point has
        no number.
        """
        documents = [records.plain(point) for point in (*(self.angle or ()), *(self.path or ()))]
        values = {name: value for point in documents for name, value in point.items() if name != "tips"}
        gaps = {name: np.full(np.shape(value), np.nan).tolist() for name, value in values.items()}
        return {name: np.array([point.get(name, gap) for point in documents]) for name, gap in gaps.items()}

    def rising_strain(self) -> dict[str, Float]:
        """Return the stress-strain response of a one-leg path to a rising load, as in a test.

        Arrays (v,) by name have the v corners of the curves: the leading strain first, then all stresses.  Where bonds
        break, the stress drops to the next stable branch or, under a prescribed stress, the strain jumps.  Raises
        ValueError for any other result, and if the leading strain does not rise with the load.
        """
        from feti_homog.results import path_curves  # unused in other analyses

        curve = path_curves.rising_strain(self.document)
        if curve is None or self.peak is None:
            raise ValueError("only a path of one leg whose leading strain rises has a response to a rising strain")
        sign = np.sign((self.path or ())[-1].strain[path_curves.leading_component(self.document)])
        _, names = voigt.voigt_names(curve.shape[1] - 1)
        stresses = dict(zip(names, curve[:, :-1].T, strict=True))
        return {self.peak.strain_name: sign * curve[:, -1]} | stresses

    def __getattr__(self, name: str) -> Any:
        """Return a number, such as E1, of a record in CONSTANTS.  Raises AttributeError with a hint for other names."""
        parts = {key: vars(part) for key, part in vars(self).items() if is_dataclass(part)}
        table = {key: value for record in CONSTANTS for key, value in parts.get(record, {}).items()}
        if name in table:
            return table[name]
        places = {key: f"result.{record}" for record, part in parts.items() for key in part}
        names = [*table, *(key for key, value in vars(self).items() if value is not None)]
        hint = wording.suggestion(name, names, places)
        raise AttributeError(f"this result has no {name}: {hint}", name=name, obj=self)

    def __repr__(self) -> str:
        return f"Result({self.case.get('name', '')!r}, {self.case['analysis']['type']}, {self.status})"

    def __str__(self) -> str:
        from feti_homog.report.text import summary  # few runs print a result

        return summary.short_summary(self.document)

    def _repr_html_(self) -> str:
        from feti_homog.report.text import summary  # only notebooks show tables

        return summary.notebook(self.document)


RECORDS = (*filter(is_dataclass, (*vars(cell_records).values(), *vars(result_records).values())), Result)
