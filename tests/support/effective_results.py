"""Documents of results with six by six effective constants, and tensors to turn them with.

Axis 1 of the constants here is the fibre, as in the literature.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.results import result_json
from feti_homog.typing import Float

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
# Rows: x1, x2, x3 of the cell; columns: axes 1, 2, 3, of which 1 lies along x3, 2 along x1 and 3 along x2.
COSINES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Sample:
    """Orthotropic constants in the order E1, E2, E3, nu12, nu13, nu23, G12, G13, G23, with expansions.

    Turned about the fibre by so many degrees against the cell.
    """

    constants: tuple[float, ...]
    expansion: tuple[float, float, float] | None
    turn: float = 0.0

    @property
    def compliance(self) -> Float:
        """(6, 6) in the axes of the constants, [11, 22, 33, 23, 13, 12]."""
        E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = self.constants
        S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
        S[0, 1] = S[1, 0] = -nu12 / E1
        S[0, 2] = S[2, 0] = -nu13 / E1
        S[1, 2] = S[2, 1] = -nu23 / E2
        return S

    @property
    def cosines(self) -> Float:
        """Rows: axes of the cell; columns: axes of the constants."""
        c, s = np.cos(np.radians(self.turn)), np.sin(np.radians(self.turn))
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ COSINES

    @property
    def stiffness_in_the_cell(self) -> Float:
        return turned_stiffness(np.linalg.inv(self.compliance), self.cosines)

    @property
    def expansion_in_the_cell(self) -> Float | None:
        """(6,) with engineering shears."""
        if self.expansion is None:
            return None
        tensor = self.cosines @ np.diag(self.expansion) @ self.cosines.T
        return np.array([tensor[pair] * (1 if k < 3 else 2) for k, pair in enumerate(PAIRS)])


# Figures of finite elements: boron and aluminium, square, 47 % of fibres; glass and epoxy, hexagonal, 55 %.
BORON_ALUMINIUM = Sample(
    (215.334687, 143.955632, 143.955632, 0.194557155, 0.194557155, 0.255133319, 54.3778718, 54.3778718, 45.8243281),
    (10.9936815e-6, 16.694874e-6, 16.694874e-6),
)
GLASS_EPOXY = Sample(
    (41.720812, 10.536603, 10.536603, 0.27089118, 0.27089118, 0.41871477, 3.8936826, 3.8936826,
     10.536603 / 2 / 1.41871477),
    (7.0467124e-6, 30.341346e-6, 30.341346e-6),
)  # fmt: skip
# Invented: no two constants agree.
DISTINCT = Sample((41.7, 10.5, 13.1, 0.27, 0.23, 0.37, 3.9, 4.7, 5.3), (-0.7e-6, 30.3e-6, 21.9e-6))
TURNED = Sample(DISTINCT.constants, DISTINCT.expansion, turn=25.0)
TURNED_WITHOUT_EXPANSION = Sample(DISTINCT.constants, None, turn=25.0)


def tensor_of_stiffness(C: Float) -> Float:
    """(3, 3, 3, 3) of a stiffness in Voigt's order."""
    place = {pair: k for k, (i, j) in enumerate(PAIRS) for pair in ((i, j), (j, i))}
    return np.array(
        [
            [[[C[place[i, j], place[k, m]] for m in range(3)] for k in range(3)] for j in range(3)]
            for i in range(3)
        ]
    )  # fmt: skip


def turned_stiffness(C: Float, cosines: Float) -> Float:
    """C_ijkl = a_ip a_jq a_kr a_ms C_pqrs in Voigt's order."""
    turned = np.einsum("ip,jq,kr,ms,pqrs->ijkm", *[cosines] * 4, tensor_of_stiffness(C))
    return np.array([[turned[*row, *column] for column in PAIRS] for row in PAIRS])


def document(sample: Sample, **more: Any) -> dict[str, Any]:
    """Return the part of result.json that cards read, for these constants."""
    E1, E2, _, nu12, _, nu23, G12, _, G23 = GLASS_EPOXY.constants
    alpha = sample.expansion_in_the_cell
    C = sample.stiffness_in_the_cell
    return {
        "schema": result_json.SCHEMA,
        "version": "0.1.0",
        "case": {
            "name": "a composite, 55 %",
            "analysis": {"type": "stiffness", "plane": "generalized"},
            "output": {"stress_unit": "GPa"},
        },
        "faults": [],
        "status": "done",
        "effective_stiffness": C,
        "compliance": np.linalg.inv(C),
        "transversely_isotropic": {
            "E_axial": E1, "E_transverse": E2, "nu_axial": nu12, "nu_transverse": nu23, "G_axial": G12,
            "G_transverse": G23, "K_transverse": 1.0, "deviation": 0.01,
            "expansion_axial": None if alpha is None else GLASS_EPOXY.expansion[0],
            "expansion_transverse": None if alpha is None else GLASS_EPOXY.expansion[1],
        },
        **({} if alpha is None else {"thermal_expansion": alpha}),
        **more,
    }  # fmt: skip


def changed(document: Mapping[str, Any], section: str, **entries: Any) -> dict[str, Any]:
    """Return the document with other entries in a section of its case."""
    case = document["case"] | {section: document["case"].get(section, {}) | entries}
    return dict(document) | {"case": case}
