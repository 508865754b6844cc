"""`analysis.type = "conductivity"`: the effective conductivity k^ef, of heat, electricity or diffusion."""

from typing import Any

import numpy as np

from feti_homog.analysis.constants import energy_error, fibre_radii, note_accuracy, note_outside
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import MeshErrors
from feti_homog.homogenization import averaging, phase_laws, unit_cell
from feti_homog.materials import laws, phase_bounds
from feti_homog.typing import Float


def run(context: AnalysisContext) -> dict[str, Any]:
    """Compute the `Result` entries of a conductivity.  Collective.

    These are `effective_conductivity` and, where they exist or are asked for, `conductivity_estimates`, `sensitivities`
    and `mesh_error`.  Flux q and temperature T obey div q = 0, q = -k grad T, grad T = G + grad T* with the macroscopic
    gradient G and periodic T*, as in axial shear with shear moduli k.  A gradient along the fibres has T* = 0 unless a
    phase has k13 or k23.  Column j of the effective conductivity is minus the mean flux under the unit gradient j.
    """
    columns, errors, responses = context.unit_states(context.bonds(None), context.loads.zero_multipliers())
    k = columns["stiffness"]
    context.checks.require("k^ef", {"symmetry": averaging.asymmetry(k)})
    document: dict[str, Any] = {"effective_conductivity": k}
    if (forms := closed_forms(context.cell)) is not None:
        document["conductivity_estimates"] = forms
    if context.case.output.sensitivities:
        from feti_homog.analysis.sensitivities import sensitivities  # few runs need sensitivities

        document |= sensitivities(context, document, responses, False)
    if not errors:
        return document
    energy, absolute = energy_error(k, errors)["mesh_error"], np.where(k == 0.0, 0.0, errors[0].absolute)  # 0 is exact
    note_accuracy(context, energy)
    if forms is not None and forms.wiener is not None and forms.hashin_shtrikman is not None:
        _note_bounds(context, k, absolute, forms, energy)
    return document | {"mesh_error": MeshErrors(effective_conductivity=absolute, energy=energy, constants={})}


def closed_forms(cell: unit_cell.TornCell) -> phase_bounds.ConductivityEstimates | None:
    """Compute closed-form conductivities; None with voids, debonded arcs, or anisotropy in the plane.  Collective.

    A fibre with radius a, conductivity k and interface conductance h acts like a perfectly bonded fibre of conductivity
    1 / (1/k + 1/(h a)).  Maxwell's estimate is None if `fibre_radii` is None, bounds are None with conductances.
    """
    tensors = {phase: laws.conductivity(cell.case.material_of(phase)) for phase in cell.summary.phases}
    alike = all(np.array_equal(k, np.diag([k[0, 0], k[0, 0], k[2, 2]])) for k in tensors.values())
    if cell.summary.voids or cell.comm.allreduce(int(cell.debonded(None).sum())) or not alike:
        return None
    fractions, matrix = cell.fractions(), cell.summary.phases[0]
    c, across = np.array([fractions[phase] for phase in tensors]), np.array([k[0, 0] for k in tensors.values()])
    wiener = hashin_shtrikman = maxwell = None
    if not phase_laws.has_springs(cell.case):
        wiener = float(1 / (c @ (1 / across))), float(c @ across)
        lower, upper = (phase_bounds.dispersed(c, across, float(k)) for k in (across.min(), across.max()))
        hashin_shtrikman = lower, upper
    if (radii := fibre_radii(cell)) is not None:
        conductances = phase_laws.springs(cell.case, cell.solver.problem).stiffness
        h = conductances[0][0] if conductances else np.inf  # `fibre_radii` requires equal bonds
        acting = [across[0], *(1 / (1 / k[0, 0] + 1 / (h * radii[p])) for p, k in tensors.items() if p != matrix)]
        maxwell = phase_bounds.dispersed(c, acting, float(across[0]))
    axial = float(c @ [k[2, 2] for k in tensors.values()])
    return phase_bounds.ConductivityEstimates(axial, wiener, hashin_shtrikman, maxwell)


def _note_bounds(
    context: AnalysisContext, k: Float, errors: Float, forms: phase_bounds.ConductivityEstimates, energy: float
) -> None:
    """Check k across the fibres against bounds by `note_outside`: Hashin-Shtrikman's if isotropic, else Wiener's."""
    least, largest = np.linalg.eigvalsh((k + k.T)[:2, :2] / 2)
    error = np.asarray(errors[:2, :2].max())
    limits = forms.hashin_shtrikman if largest - least <= error else forms.wiener
    assert limits is not None
    values = {"k across, least": np.asarray(least), "k across, largest": np.asarray(largest)}
    note_outside(context, dict.fromkeys(values, limits), values, dict.fromkeys(values, error), energy)
