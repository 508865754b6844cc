"""Express the effective material of a result in card axes (axis 1 along the fibre); write cards of conductivities.

Abaqus Keywords Guide and CalculiX user's manual, *CONDUCTIVITY, TYPE=ORTHO: k11, k22, k33.  ANSYS: KXX, KYY, KZZ.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.text import constant_tables
from feti_homog.typing import Document, Float

FIBRE_FIRST = (2, 0, 1)
"""The axes of the cell along which axes 1, 2, 3 of a card lie: x3, x1, x2, a right-handed turn."""
PAIRS: list[tuple[int, ...]] = [(int(name[1]) - 1, int(name[2]) - 1) for name in voigt.SPATIAL_STRESSES]
"""The pairs of axes of Voigt's order [11, 22, 33, 23, 13, 12]."""
ORDER = [PAIRS.index(tuple(sorted((FIBRE_FIRST[i], FIBRE_FIRST[j])))) for i, j in PAIRS]
"""The cell's Voigt components in the order of a card: C_card = C_cell[ORDER][:, ORDER]."""
COUPLINGS = ~np.eye(6, dtype=bool)
"""(6, 6) entries at which the stiffness of an orthotropic material is 0 in material axes."""
COUPLINGS[:3, :3] = False
AXES = (
    "Axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. So "
    f"{', '.join(engineering_constants.OF_THE_CELL)} of this card are "
    f"{', '.join(engineering_constants.OF_THE_CELL.values())} of the cell. nu_ij = -eps_j/eps_i under stress along i."
)
CONDUCTOR_AXES = "Axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. q = -k grad T."
TINY = float(np.finfo(float).tiny)
NEGLIGIBLE = 1e-3
"""Couplings up to this fraction of sqrt(C_ii C_jj), and shears up to this fraction of the largest expansion, are left
out: far above the noise of irregular meshes in symmetric cells (1e-6), below the accuracy of constants (1e-2)."""


@dataclass(frozen=True, eq=False)
class EffectiveMaterial:
    """A linear elastic material in card axes, with axis 1 along the fibre.

    Attributes:
        name: case name.
        version: program version.
        stress_unit: the case's label, empty if it has none.
        symmetry: statement on the material symmetry, for the comments of a card.
        compliance: (6, 6) in Voigt's order [11, 22, 33, 23, 13, 12] with engineering shears, symmetric
            positive definite; axes 2 and 3 are x1 and x2 of the cell.
        expansion: (6,) strains per unit of temperature in the same order, or None.
        errors: estimated mesh errors, by name of constant or expansion.
    """

    name: str
    version: str
    stress_unit: str
    symmetry: str
    compliance: Float
    expansion: Float | None
    errors: Mapping[str, float]

    @property
    def is_orthotropic(self) -> bool:
        """Return whether shears are uncoupled in the compliance and absent from the expansion."""
        shears = np.zeros(3) if self.expansion is None else self.expansion[3:]
        return not self.compliance[COUPLINGS].any() and not shears.any()

    @property
    def stiffness(self) -> Float:
        """Return the symmetric stiffness (6, 6), the inverse of the compliance."""
        inverse = np.linalg.inv(self.compliance)
        return np.asarray((inverse + inverse.T) / 2.0)

    @property
    def constants(self) -> dict[str, float]:
        """Return the engineering constants by name, in the order of an Abaqus card."""
        return {name: float(value) for name, value in engineering_constants.along_axes(self.compliance).items()}


def in_axes_of_the_cell(document: Document) -> EffectiveMaterial:
    """Return the material of a result as computed, with its components renumbered to card axes.

    If the couplings and expansions of shears are all within NEGLIGIBLE, they are set to 0: the material is orthotropic.
    Raises CaseError if the result has no linear spatial stiffness, or did not converge; KeyError, TypeError or
    ValueError if it is damaged.
    """
    C = _stiffness(document)[np.ix_(ORDER, ORDER)]
    computed = document.get("thermal_expansion")
    expansion = None if computed is None else numbers(computed, (6,))[ORDER]
    compliance = np.linalg.inv(C)
    size = np.sqrt(np.diag(C))
    sizes = [float(np.abs(C / np.outer(size, size))[COUPLINGS].max())]
    text = f"couplings of shears of up to {sizes[0]:.2g} sqrt(Cii Cjj)"
    if expansion is not None:
        sizes.append(float(np.abs(expansion[3:]).max() / max(np.abs(expansion).max(), TINY)))
        text += f" and shears of up to {sizes[1]:.2g} of the largest expansion"
    if max(sizes) > NEGLIGIBLE:
        symmetry = f"Not orthotropic in these axes: there are {text}; up to {NEGLIGIBLE} would be left out."
    else:
        symmetry = f"Orthotropic; {text} are left out."
        compliance = np.where(COUPLINGS, 0.0, compliance)
        expansion = None if expansion is None else expansion * [1, 1, 1, 0, 0, 0]
    errors = constant_tables.in_material_axes(constant_tables.mesh_errors(document))
    return _material(document, symmetry, (compliance + compliance.T) / 2.0, expansion, errors)


def nearest_transversely_isotropic(document: Document) -> EffectiveMaterial:
    """Return the nearest transversely isotropic material of a result.  Raises like `in_axes_of_the_cell`."""
    _stiffness(document)
    computed = document["transversely_isotropic"]
    names = ("E_axial", "E_transverse", "nu_axial", "nu_transverse", "G_axial")
    E_a, E_t, nu_a, nu_t, G_a = numbers([computed[name] for name in names], (5,))
    compliance = np.diag([1 / E_a, 1 / E_t, 1 / E_t, 2 * (1 + nu_t) / E_t, 1 / G_a, 1 / G_a])
    compliance[0, 1:3] = compliance[1:3, 0] = -nu_a / E_a
    compliance[1, 2] = compliance[2, 1] = -nu_t / E_t
    if not voigt.is_positive_definite(compliance):
        raise ValueError("transversely_isotropic: no stable material")
    expansion = None
    if computed["expansion_axial"] is not None:
        axial, transverse = numbers([computed["expansion_axial"], computed["expansion_transverse"]], (2,))
        expansion = np.array([axial, transverse, transverse, 0.0, 0.0, 0.0])
    symmetry = f"The nearest transversely isotropic material, at a relative distance of {computed['deviation']:.2g}."
    if ranges := constant_tables.ranges_across(document):
        symmetry += f" Over all directions across the fibres the cell has {ranges}."
    known = (document.get("mesh_error") or {}).get("constants", {})
    cards = engineering_constants.ABOUT_FIBRES.items()
    errors = {name: float(known[key]) for key, about in cards if key in known for name in about.card}
    return _material(document, symmetry, compliance, expansion, errors)


def _material(
    document: Document, symmetry: str, compliance: Float, expansion: Float | None, errors: Mapping[str, float]
) -> EffectiveMaterial:
    """Return a material with the name, version and unit of a result; the expansion may be None."""
    case, unit = document["case"], document["case"]["output"]["stress_unit"]
    symmetry += _bound(document)
    return EffectiveMaterial(case["name"], document["version"], unit, symmetry, compliance, expansion, errors)


def _bound(document: Document) -> str:
    """Return the remark that the boundary makes the result a bound, after a space; "" without it."""
    return "".join(f" {line}." for line in document.get("remarks", ()) if line.startswith("[cell] boundary"))


def require_done(document: Document) -> None:
    """Raise CaseError with the first fault of a result that is unfinished, did not converge or has other faults."""
    if document["status"] != "done":
        faults = document.get("faults") or ["it was not finished"]
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise CaseError(f'its status is "{document["status"]}": {faults[0]}{more}; run the case again')


def _stiffness(document: Document) -> Float:
    """Return the symmetric positive definite stiffness (6, 6) in cell axes.  Raises CaseError if a result has none."""
    require_done(document)
    analysis = document["case"]["analysis"]
    if document.get("effective_stiffness") is None:
        text = f'analysis.type = "{analysis["type"]}" has no effective stiffness'
        raise CaseError(f'{text}; cards need "stiffness", "envelope" or "conductivity"')
    if analysis["plane"] != "generalized":
        raise CaseError(f'plane = "{analysis["plane"]}" gives constants of the plane; cards need plane = "generalized"')
    if document.get("effective_stiffness_compression") is not None:
        raise CaseError("its debonded faces touch under some loads alone; cards are of linear materials")
    C = numbers(document["effective_stiffness"], (6, 6))
    C = (C + C.T) / 2.0
    if not voigt.is_positive_definite(C):
        raise CaseError("its effective stiffness is not positive definite; cards are of stable materials")
    return C


def numbers(value: Any, shape: tuple[int, ...]) -> Float:
    """Convert a value to a finite array of shape `shape`.  Raises TypeError or ValueError if that is impossible."""
    array = np.array(value, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"expected {' x '.join(map(str, shape))} finite numbers")
    return array


def comments(material: EffectiveMaterial, mark: str) -> list[str]:
    """Return the comment lines at the start of a card, in ASCII, each beginning with `mark`."""
    stress = material.stress_unit or "the unit of the moduli in the case file"
    paragraphs = [
        f"Effective material of {material.name}, by feti_homog {material.version}.",
        AXES,
        f"Stresses in {stress}, expansions per unit of temperature; nothing is converted.",
        material.symmetry,
    ]
    if material.expansion is None:
        paragraphs.append("No thermal expansion: not every phase of the case gives one.")
    if material.errors:
        errors = ", ".join(f"{name} {value:.1e}" for name, value in material.errors.items())
        paragraphs.append(f"Estimated errors by the mesh: {errors}.")
    return comment_lines(paragraphs, mark)


def comment_lines(paragraphs: Iterable[str], mark: str) -> list[str]:
    """Wrap paragraphs to comment lines in ASCII that begin with `mark`."""
    lines = (line for text in paragraphs for line in wrap(text.encode("ascii", "backslashreplace").decode(), 100))
    return [f"{mark} {line}" for line in lines]


def number(value: float) -> str:
    """Write a value with nine significant digits, more than the mesh justifies, in at most 16 characters."""
    return f"{float(value) + 0.0:.9g}"  # no -0.0


def identifier(name: str) -> str:
    """Convert a name to at most 60 letters, digits and single underscores, which replace all other characters.

    The prefix `material_` comes before an identifier that does not begin with a letter.
    """
    word = re.sub(r"[\W_]+", "_", name, flags=re.ASCII)[:60].strip("_")
    return word if word[:1].isalpha() else f"material_{word}".strip("_")


def conductor_card(document: Document, form: str, symmetry: str) -> str:
    """Return the card of a conductivity as computed, or of the nearest "transversely isotropic" conductivity.

    A card has no couplings k_ij: as computed, they must be at most `NEGLIGIBLE` sqrt(k_ii k_jj).  Raises CaseError if
    they are larger, the result did not converge, or the format has no conductivity; KeyError, TypeError or ValueError
    if the result is damaged.
    """
    require_done(document)
    if form not in (known := ("abaqus", "calculix", "ansys")):
        raise CaseError(f"--format {form} has no card of a conductivity; expected one of {', '.join(known)}")
    turn = np.ix_(FIBRE_FIRST, FIBRE_FIRST)
    k = numbers(document["effective_conductivity"], (3, 3))[turn]
    values, name = np.diag(k).copy(), document["case"]["name"]
    couplings = float((np.abs(k) / np.sqrt(np.outer(values, values)))[~np.eye(3, dtype=bool)].max())
    text = f"Couplings of up to {couplings:.2g} sqrt(kii kjj) are left out."
    if symmetry == "transversely isotropic":
        values[1:] = values[1:].mean()
        text += " k22 and k33 are the mean across the fibres."
    elif couplings > NEGLIGIBLE:
        raise CaseError("its conductivity has couplings in its axes; use --transversely-isotropic")
    text += _bound(document)
    origin = f"Effective conductivity of {name}, by feti_homog {document['version']}; nothing is converted."
    paragraphs = [origin, CONDUCTOR_AXES, text]
    if (errors := (document.get("mesh_error") or {}).get("effective_conductivity")) is not None:
        estimates = np.diag(numbers(errors, (3, 3))[turn])
        named = ", ".join(f"k{i + 1}{i + 1} {error:.1e}" for i, error in enumerate(estimates))
        paragraphs.append(f"Estimated errors by the mesh: {named}.")
    words = [*map(number, values)]
    if form in ("abaqus", "calculix"):
        keywords = [f"*MATERIAL, NAME={identifier(name)}", "*CONDUCTIVITY, TYPE=ORTHO"]
        return "\n".join([*comment_lines(paragraphs, "**"), *keywords, ", ".join(words)])
    paragraphs.append("Material 1; x, y, z are axes 1, 2, 3. To be read in /PREP7.")
    commands = [f"MP,K{axis * 2},1,{word}" for axis, word in zip("XYZ", words, strict=True)]
    return "\n".join([*comment_lines(paragraphs, "!"), *commands])
