"""Material cards for an effective conductivity, in card axes (axis 1 along the fibre).

Abaqus Keywords Guide and CalculiX CrunchiX user's manual, *CONDUCTIVITY, TYPE=ORTHO: k11, k22, k33.  ANSYS Material
Reference: KXX, KYY, KZZ.  MOOSE: GenericConstantRankTwoTensor takes the nine entries by rows, and kernel
AnisoHeatConduction reads the property thermal_conductivity.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.report.cards import effective_material
from feti_homog.results import result_json
from feti_homog.typing import Document, Float

KEYWORD = "*CONDUCTIVITY, TYPE=ORTHO"
AXES = "Axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. q = -k grad T."


@dataclass(frozen=True, eq=False)
class EffectiveConductor:
    """A conductivity k (3, 3) in card axes, with its name and the paragraphs above its card."""

    name: str
    k: Float
    paragraphs: tuple[str, ...]

    def comments(self, mark: str) -> list[str]:
        """Return the comment lines above the card."""
        return effective_material.comment_lines(self.paragraphs, mark)

    def principal(self) -> list[str]:
        """Return k11, k22, k33 as text.  Raises CaseError for other entries, for which most cards have no place."""
        if (self.k - np.diag(np.diag(self.k))).any():
            raise CaseError(
                "its conductivity has couplings in its axes, which this format does not carry; "
                "use --transversely-isotropic, or --format moose or csv"
            )
        return [effective_material.number(value, 20) for value in np.diag(self.k)]


def conductor(document: Document, symmetry: str) -> EffectiveConductor:
    """Return the computed conductivity, or the nearest transversely isotropic one.

    Couplings up to `NEGLIGIBLE` sqrt(k_ii k_jj) are left out.

    Raises:
        CaseError: the result did not converge.
        KeyError, TypeError, ValueError: the result is damaged.
    """
    effective_material.require_done(document)
    turn = np.ix_(effective_material.FIBRE_FIRST, effective_material.FIBRE_FIRST)
    k = effective_material.numbers(document["effective_conductivity"], (3, 3))[turn]
    size = np.sqrt(np.outer(np.diag(k), np.diag(k)))
    couplings = float((np.abs(k) / size)[~np.eye(3, dtype=bool)].max())
    text = f"Couplings of up to {couplings:.2g} sqrt(kii kjj)"
    if symmetry == "transversely isotropic":
        text += " and unlike conductivities across the fibres are left out."
        k = np.diag([k[0, 0], *[(k[1, 1] + k[2, 2]) / 2] * 2])
    elif couplings <= effective_material.NEGLIGIBLE:
        text, k = f"{text} are left out.", np.diag(np.diag(k))
    errors = (document.get("mesh_error") or {}).get("effective_conductivity")
    case, paragraphs = document["case"], [f"{text.removesuffix('.')}."]
    if errors is not None:
        values = np.diag(effective_material.numbers(errors, (3, 3))[turn])
        named = ", ".join(f"k{i + 1}{i + 1} {value:.1e}" for i, value in enumerate(values))
        paragraphs.append(f"Estimated errors by the mesh: {named}.")
    origin = f"Effective conductivity of {case['name']}, by feti_homog {document['version']}; nothing is converted."
    return EffectiveConductor(case["name"], (k + k.T) / 2, (origin, AXES, *paragraphs))


def keyword_card(conductor: EffectiveConductor) -> str:
    """Return the card for Abaqus and CalculiX."""
    head = f"*MATERIAL, NAME={effective_material.identifier(conductor.name)}"
    return "\n".join([*conductor.comments("**"), head, KEYWORD, ", ".join(conductor.principal())])


def ansys(conductor: EffectiveConductor) -> str:
    """Return the card for ANSYS."""
    values = zip("XYZ", conductor.principal(), strict=True)
    head = "! Material 1; x, y, z are axes 1, 2, 3. To be read in /PREP7."
    return "\n".join([*conductor.comments("!"), head, *(f"MP,K{axis * 2},1,{value}" for axis, value in values)])


def moose(conductor: EffectiveConductor) -> str:
    """Return the MOOSE card, a block [Materials]."""
    lines = effective_material.moose_block(
        f"{effective_material.identifier(conductor.name)}_conductivity",
        type="GenericConstantRankTwoTensor",
        tensor_name="thermal_conductivity",
        tensor_values=effective_material.quoted(conductor.k.ravel()),
    )
    return "\n".join([*conductor.comments("#"), "[Materials]", *lines, "[]"])


def csv_table(conductor: EffectiveConductor) -> str:
    """Write the tensor as a table in CSV format."""
    meaning = "flux along axis {} under the unit gradient along axis {}, less its sign"
    rows = [
        (f"k{i + 1}{j + 1}", effective_material.number(conductor.k[i, j]), "", meaning.format(i + 1, j + 1))
        for i, j in zip(*np.triu_indices(3), strict=True)
    ]
    return result_json.csv_text([effective_material.CSV_COLUMNS, *rows]).removesuffix("\n")


FORMATS: dict[str, Callable[[EffectiveConductor], str]] = {
    "abaqus": keyword_card, "calculix": keyword_card, "ansys": ansys, "moose": moose, "csv": csv_table,
}  # fmt: skip
