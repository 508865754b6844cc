"""The problems of a cell under its loads: the one in the plane and, in generalized plane strain, the axial one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import Equilibrium
from feti_homog.interface.loads.load import Load
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.typing import Float


class CellLoads:
    """Loads of a cell, and its averages under them.

    Attributes:
        problems: that of the plane, in which faces may touch, then the axial one where there is one.
        interfaces: those of all problems together.
        names: of the unit loads of all problems.
    """

    def __init__(self, cell: TornCell, contact: bool) -> None:
        self.problems = tuple(Homogenization(each, contact and each is cell) for each in cell.problems)
        self.interfaces = CoupledInterfaces(*(problem.interface for problem in self.problems))
        self.names = tuple(name for problem in self.problems for name in problem.loads)

    @property
    def plane(self) -> Homogenization:
        """The problem of the plane."""
        return self.problems[0]

    def load(self, target: Mapping[str, float]) -> Load:
        """Return the load that a waypoint names, of all problems."""
        stress = dict(zip(SPATIAL_STRAINS, SPATIAL_STRESSES, strict=True)) | {"temperature": "temperature"}
        values = [target.get(name, target.get(stress[name], 0.0)) for name in self.names]
        return Load(np.array(values), np.array([name not in target for name in self.names]))

    def zero_multipliers(self) -> list[Float]:
        """First multipliers of each unit load when there are no better ones."""
        return [np.zeros(problem.cell.solver.rows) for problem in self.problems for _ in problem.loads]

    def responses(self, state: Equilibrium, scale: float) -> list[Response]:
        """Return the averages of `scale` times the equilibrium of all problems.

        Collective; raises as `Homogenization.response`.
        """
        return [problem.response(own, scale) for problem, own in zip(self.problems, state.problems, strict=True)]

    def undetermined(self, responses: Sequence[Response]) -> list[str]:
        """Return the strains under a load that nothing determines. Collective."""
        pairs = zip(self.problems, responses, strict=True)
        masks = np.concatenate([problem.interface.undetermined(own.state) for problem, own in pairs])
        return [name for name, found in zip(self.names, masks, strict=True) if found]

    def secants(self, responses: Sequence[Response], sign: float) -> dict[str, Float]:
        """Return the secant stiffness (39) as `stiffness`, (3, 3) or (6, 6), and if a temperature is a load
        `thermal_stress` (6,), from the responses to plus or minus each unit load."""
        matrices, first = list[Float](), 0
        for problem in self.problems:
            end = first + len(problem.loads)
            matrices.append(np.stack([sign * r.stress for r in responses[first:end]], axis=1))
            first = end
        return phase_laws.secants(*matrices)

    def means(self, responses: Sequence[Response]) -> dict[str, Float | float]:
        """Macroscopic `strain` and `stress` of the responses of all problems, and `temperature` if it is a load."""
        strain = phase_laws.components(*(response.strain for response in responses))
        stress = phase_laws.components(*(response.stress for response in responses))
        heat = {"temperature": float(responses[0].strain[-1])} if "temperature" in self.names else {}
        return {"strain": strain, "stress": stress} | heat
