"""Material cards for an effective conductivity, in card axes (axis 1 along the fibre).

Abaqus Keywords Guide and CalculiX user's manual, *CONDUCTIVITY, TYPE=ORTHO: k11, k22, k33.  ANSYS: KXX, KYY, KZZ.
"""

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.report.cards import effective_material
from feti_homog.typing import Document

AXES = "Axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. q = -k grad T."


def card(document: Document, form: str, symmetry: str) -> str:
    """Return the card for a conductivity, as computed or the nearest one that is "transversely isotropic".

    Couplings up to `NEGLIGIBLE` sqrt(k_ii k_jj) are left out.

    Raises:
        CaseError: the result did not converge, has larger couplings, or the format has no conductivity.
        KeyError, TypeError, ValueError: the result is damaged.
    """
    effective_material.require_done(document)
    turn = np.ix_(effective_material.FIBRE_FIRST, effective_material.FIBRE_FIRST)
    k = effective_material.numbers(document["effective_conductivity"], (3, 3))[turn]
    values, name = np.diag(k).copy(), document["case"]["name"]
    couplings = float((np.abs(k) / np.sqrt(np.outer(values, values)))[~np.eye(3, dtype=bool)].max())
    text = f"Couplings of up to {couplings:.2g} sqrt(kii kjj) are left out."
    if symmetry == "transversely isotropic":
        values[1:], text = values[1:].mean(), f"{text} k22 and k33 are the mean across the fibres."
    elif couplings > effective_material.NEGLIGIBLE:
        raise CaseError("its conductivity has couplings in its axes; use --transversely-isotropic")
    origin = f"Effective conductivity of {name}, by feti_homog {document['version']}; nothing is converted."
    paragraphs = [origin, AXES, text]
    if (errors := (document.get("mesh_error") or {}).get("effective_conductivity")) is not None:
        estimates = np.diag(effective_material.numbers(errors, (3, 3))[turn])
        named = ", ".join(f"k{i + 1}{i + 1} {error:.1e}" for i, error in enumerate(estimates))
        paragraphs.append(f"Estimated errors by the mesh: {named}.")
    words = [effective_material.number(value, 20) for value in values]
    if form in ("abaqus", "calculix"):
        keywords = [f"*MATERIAL, NAME={effective_material.identifier(name)}", "*CONDUCTIVITY, TYPE=ORTHO"]
        return "\n".join([*effective_material.comment_lines(paragraphs, "**"), *keywords, ", ".join(words)])
    if form == "ansys":
        paragraphs.append("Material 1; x, y, z are axes 1, 2, 3. To be read in /PREP7.")
        commands = [f"MP,K{axis * 2},1,{word}" for axis, word in zip("XYZ", words, strict=True)]
        return "\n".join([*effective_material.comment_lines(paragraphs, "!"), *commands])
    raise CaseError(f"--format {form} has no card of a conductivity; expected one of abaqus, calculix, ansys")
