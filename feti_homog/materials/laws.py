"""Derive the plane and spatial stiffness and the expansion of each phase, and check the stiffness contrast.

The Voigt order is [11, 22, 12] in the plane, [11, 22, 33, 23, 13, 12] in space, with engineering shears.  x3 is normal
to a plane of symmetry of every phase, so 23 and 13 couple only with each other.  Each ValueError names keys at fault.
"""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from feti_homog.materials import material_forms, voigt
from feti_homog.schema import wording
from feti_homog.typing import Float

COUPLINGS = ((0, 3), (0, 4), (1, 3), (1, 4), (2, 3), (2, 4), (3, 5), (4, 5))
"""Entries of a spatial stiffness that vanish where x3 is normal to a plane of symmetry."""
OF_DATA_SHEETS = "axis 3 is along the fibres; for data sheets: E_axial, E_transverse, nu_axial, nu_transverse, G_axial"
NEEDED: dict[type[Any], tuple[tuple[str, ...], tuple[str, ...], str]] = {
    material_forms.Orthotropic: (("E3", "nu13", "nu23"), ("G13", "G23"), f"; {OF_DATA_SHEETS}"),
    material_forms.TransverselyIsotropic: (("E_axial", "nu_axial"), ("G_axial",), ""),
}
"""By form: constants that plane strain needs, constants that generalized plane strain needs too, and a hint."""
# Relative deviation, due to rounding, up to which a material counts as isotropic or transversely isotropic.
ISOTROPY = 1e-9
# Relative asymmetry up to which a matrix counts as symmetric, because its digits are rounded.
NOISE = 1e-9
# Beyond the first contrast, rounding of displacements may exceed the allowed stress error of the soft phase; beyond the
# second, no digit of the soft phase's stresses is left.
WORRYING_CONTRAST, LARGEST_CONTRAST = 1e10, 1e14


def stiffness_of(material: material_forms.Material, plane: str) -> Float:
    """Return the stiffness, (3, 3) or in generalized plane strain (6, 6); in conduction, the conductivity (3, 3).

    Raises ValueError as `conductivity`, `plane_stiffness` and `spatial_stiffness` do.
    """
    if voigt.PLANE_STATES[plane].is_scalar:
        return conductivity(material)
    return spatial_stiffness(material) if voigt.PLANE_STATES[plane].is_spatial else plane_stiffness(material, plane)


def plane_stiffness(material: material_forms.Material, plane: str) -> Float:
    """Return the stiffness C (3, 3): [S11, S22, S12] = C [E11, E22, gamma12], symmetric positive definite.

    `plane` is "stress" (S33 = 0), "strain" (E33 = 0), or "generalized", where C is the block at E33 = 0.  Raises
    ValueError if the constants do not determine C, contradict each other or belong to no stable material.
    """
    material = _elastic(material)
    if isinstance(material, material_forms.Isotropic):
        lame, shear = _lame(material, plane)
        return np.array([[lame + 2 * shear, lame, 0.0], [lame, lame + 2 * shear, 0.0], [0.0, 0.0, shear]])
    is_sheet = voigt.PLANE_STATES[plane].is_sheet
    if isinstance(material, material_forms.General):
        stiffness = _checked_stiffness(material)
        if len(stiffness) == 3:
            return stiffness
        block, out = stiffness[voigt.IN_PLANE_BLOCK], stiffness[voigt.IN_PLANE, 2]
        return np.asarray(block - np.outer(out, out) / stiffness[2, 2]) if is_sheet else block
    compliance = stable_compliance(material, plane)
    reduced = compliance[voigt.IN_PLANE_BLOCK]
    if not is_sheet:
        out = compliance[voigt.IN_PLANE, 2]
        reduced = reduced - np.outer(out, out) / compliance[2, 2]
    return voigt.rotated(np.asarray(np.linalg.inv(reduced), float), _angle(material))


def conductivity(material: material_forms.Material) -> Float:
    """Return the conductivity k (3, 3) in cell axes; ValueError unless it is given, symmetric, positive definite."""
    k = material.conductivity
    if k is None:
        raise ValueError('conductivity: missing; [analysis] type = "conductivity" needs it')
    if isinstance(k, material_forms.FibreConductivity):
        return np.diag([k.transverse, k.transverse, k.axial])
    if isinstance(k, float):
        return k * np.eye(3)
    R, along_axes = voigt.turned_axes(_angle(material)), _symmetric("conductivity", k)
    return np.asarray(R @ _positive_definite("conductivity", along_axes) @ R.T)


def isotropic_ratio(material: material_forms.Material) -> float | None:
    """Return Poisson's ratio of an isotropic material; None for other materials, and for a given stiffness.

    Transversely isotropic constants that agree up to ISOTROPY count as isotropic.  Raises as `transverse_ratio` does.
    """
    if isinstance(material, material_forms.TransverselyIsotropic):
        young, ratio = material.E_transverse, transverse_ratio(material)
        pairs = [(material.E_axial, young), (material.nu_axial, ratio)]
        if material.G_axial is not None:
            pairs.append((material.G_axial, young / (2 + 2 * ratio)))
        alike = all(axial is not None and math.isclose(axial, across, rel_tol=ISOTROPY) for axial, across in pairs)
        return ratio if alike else None
    return material.poisson if isinstance(material, material_forms.Isotropic) else None


def spatial_stiffness(material: material_forms.Material) -> Float:
    """Return the stiffness C (6, 6), from strains to stresses in the cell's axes, symmetric positive definite.

    Raises ValueError as `plane_stiffness` does, and for a given stiffness (3, 3).
    """
    material = _elastic(material)
    if isinstance(material, material_forms.Isotropic):
        lame, shear = _lame(material, voigt.GENERALIZED.name)
        stiffness = np.diag([2 * shear] * 3 + [shear] * 3)
        stiffness[:3, :3] += lame
        return stiffness
    if isinstance(material, material_forms.General):
        stiffness = _checked_stiffness(material)
        if len(stiffness) == 3:
            raise ValueError("stiffness: expected 6x6 in generalized plane strain; 3x3 serves one plane state only")
        return stiffness
    compliance = stable_compliance(material, voigt.GENERALIZED.name)
    return voigt.rotated(np.asarray(np.linalg.inv(compliance), float), _angle(material))


def expansion(material: material_forms.Material) -> Float | None:
    """Return the free strains (6,) per unit of temperature in the cell's axes; None if the material gives none.

    Raises ValueError if expansions are given twice or incompletely.
    """
    free = material.expansion
    if isinstance(material, material_forms.TransverselyIsotropic):
        pair = [name for name in material_forms.EXPANSION_PAIR if getattr(material, name) is not None]
        if pair and free is not None:
            raise ValueError(f"expansion, {', '.join(pair)}: exclude each other; give one or a pair")
        if len(pair) == 1:
            (other,) = set(material_forms.EXPANSION_PAIR).difference(pair)
            raise ValueError(f"{other}: missing; {pair[0]} needs it")
        axial, transverse = material.expansion_axial, material.expansion_transverse
        if axial is not None and transverse is not None:
            free = (transverse, transverse, axial)
    if free is None:
        return None
    along_axes = free if isinstance(free, tuple) else (free,) * 3
    return np.asarray(voigt.strain_rotation(-_angle(material)) @ [*along_axes, 0.0, 0.0, 0.0])


def out_of_plane(material: material_forms.Material, plane: str) -> tuple[Float, Float]:
    """Return rows s and e (3,) for plane stresses S = [S11, S22, S12]: S33 = s . S in plane strain, else E33 = e . S.

    The other row is zero; undetermined rows are NaN.  ValueError for conductors and for contradictory constants.
    """
    # E33 = row . [S11, S22, S12] + S33 / young
    material = _elastic(material)
    if isinstance(material, material_forms.Isotropic):
        contraction = -material.poisson / material.young
        row, young = np.array([contraction, contraction, 0.0]), material.young
    elif isinstance(material, material_forms.General):
        stiffness = _checked_stiffness(material)
        compliance = np.full((6, 6), np.nan) if len(stiffness) == 3 else np.linalg.inv(stiffness)
        row, young = compliance[2, voigt.IN_PLANE], 1.0 / compliance[2, 2]
    else:
        compliance = known_compliance(material)
        # Stresses turn as the transpose of strains that turn the other way.
        to_axes = voigt.strain_rotation(-_angle(material)).T[voigt.IN_PLANE_BLOCK]
        row, young = np.array([compliance[2, 0], compliance[2, 1], 0.0]) @ to_axes, 1.0 / compliance[2, 2]
    return (np.zeros(3), row) if voigt.PLANE_STATES[plane].is_sheet else (-young * row, np.zeros(3))


def _elastic(material: material_forms.Material) -> material_forms.Elastic:
    """Return the material unchanged.  Raises ValueError for a conductor, which has no stiffness."""
    if isinstance(material, material_forms.Conductor):
        raise ValueError('young, poisson: missing; conductivity alone serves [analysis] type = "conductivity"')
    return material


def _lame(material: material_forms.Isotropic, plane: str) -> tuple[float, float]:
    """Return Lame's constant, reduced in plane stress, and the shear modulus; ValueError if the former is infinite."""
    state = voigt.PLANE_STATES[plane]
    if not state.is_sheet and material.poisson >= 0.5:
        raise ValueError(f"poisson = {material.poisson}: expected less than 0.5 in {state.title}; 0.499999 serves")
    shear = material.young / (2.0 * (1.0 + material.poisson))
    thickness = 1.0 - material.poisson if state.is_sheet else 1.0 - 2.0 * material.poisson
    return 2.0 * shear * material.poisson / thickness, shear


def _angle(material: material_forms.Material) -> float:
    """Return the angle from x1 to the first material axis in degrees, positive towards x2; 0 unless orthotropic."""
    return material.angle if isinstance(material, material_forms.Orthotropic) else 0.0


def _checked_stiffness(material: material_forms.General) -> Float:
    """Return the given stiffness, (3, 3) or (6, 6), exactly symmetric, with zero COUPLINGS; ValueError if invalid."""
    stiffness = _symmetric("stiffness", material.stiffness)
    noise = NOISE * np.abs(stiffness).max()
    if len(stiffness) == 6:
        i, j = max(COUPLINGS, key=lambda entry: float(abs(stiffness[entry])))
        if abs(stiffness[i, j]) > noise:
            entry = f"C{i + 1}{j + 1} = {float(stiffness[i, j])}"
            raise ValueError(f"stiffness: {entry}: expected 0; x3 must be normal to a plane of symmetry")
        rows, columns = np.transpose(COUPLINGS)
        stiffness[rows, columns] = stiffness[columns, rows] = 0.0
    return _positive_definite("stiffness", stiffness)


def _symmetric(name: str, rows: material_forms.Matrix) -> Float:
    """Return the symmetric part of a matrix (n, n).  Raises ValueError for a relative asymmetry above NOISE."""
    matrix = np.array(rows)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=NOISE * np.abs(matrix).max()):
        raise ValueError(f"{name} = {wording.toml_value(rows)}: expected a symmetric matrix")
    return np.asarray((matrix + matrix.T) / 2.0)


def _positive_definite(name: str, matrix: Float) -> Float:
    """Return the symmetric matrix (n, n) unchanged.  Raises ValueError unless it is positive definite."""
    if not voigt.is_positive_definite(matrix):
        raise ValueError(f"{name} = {wording.toml_value(matrix.tolist())}: expected a positive definite matrix")
    return matrix


def stable_compliance(material: material_forms.Orthotropic | material_forms.TransverselyIsotropic, plane: str) -> Float:
    """Return `known_compliance` (6, 6); ValueError if no stable material has these constants in the plane state."""
    compliance, state = known_compliance(material), voigt.PLANE_STATES[plane]
    if not voigt.is_positive_definite(compliance[:2, :2]):
        if isinstance(material, material_forms.Orthotropic):
            limit = wording.limit_in_words(material.E1 / material.E2, material.nu12**2, 6)
            fault = f"nu12 = {material.nu12}: expected nu12^2 < E1/E2 = {limit}"
        else:
            fault = f"nu_transverse = {material.nu_transverse}: expected a number above -1 and below 1"
            if material.G_transverse is not None:
                limit = f"E_transverse/4 = {material.E_transverse / 4.0:.12g}"
                fault = f"G_transverse = {material.G_transverse}: expected more than {limit}"
        raise ValueError(f"{fault}; no material is stable otherwise")
    if state.is_sheet or voigt.is_positive_definite(compliance[:3, :3]):
        return compliance
    if isinstance(material, material_forms.Orthotropic):
        raise ValueError("E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance")
    E_transverse, E_axial, nu_axial = _numbers(material.E_transverse, material.E_axial, material.nu_axial)
    limit = wording.limit_in_words((1.0 - transverse_ratio(material)) * E_axial / (2.0 * E_transverse), nu_axial**2, 6)
    words = "nu_axial^2 < (1 - nu_transverse) E_axial/(2 E_transverse)"
    raise ValueError(f"nu_axial = {nu_axial}: expected {words} = {limit}; no material is stable otherwise")


def missing_constants(form: type[Any], names: Collection[str], plane: str) -> list[str]:
    """List faults, one a line: constants that a form needs in a mechanical plane state, and `names` does not have."""
    state, faults = voigt.PLANE_STATES[plane], []
    if form is material_forms.TransverselyIsotropic and not {"nu_transverse", "G_transverse"} & {*names}:
        faults.append("nu_transverse, G_transverse: missing; expected one")
    of_strain, of_space, hint = NEEDED.get(form, ((), (), ""))
    needed = of_strain + of_space if state.is_spatial else of_strain
    absent = [] if state.is_sheet else [name for name in needed if name not in names]
    if absent:
        faults.append(f"{', '.join(absent)}: missing; {state.title} needs {'it' if len(absent) == 1 else 'them'}{hint}")
    return faults


def known_compliance(material: material_forms.Orthotropic | material_forms.TransverselyIsotropic) -> Float:
    """Return the compliance (6, 6) in material axes; NaN where undetermined.  Raises as `transverse_ratio` does."""
    if isinstance(material, material_forms.TransverselyIsotropic):
        E1, E3, G13, nu31 = _numbers(material.E_transverse, material.E_axial, material.G_axial, material.nu_axial)
        nu12, nu13 = transverse_ratio(material), nu31 * E1 / E3
        moduli, ratios, shears = [E1, E1, E3], [nu12, nu13, nu13], [G13, G13, E1 / (2.0 * (1.0 + nu12))]
    else:
        moduli = _numbers(material.E1, material.E2, material.E3)
        ratios = _numbers(material.nu12, material.nu13, material.nu23)
        shears = _numbers(material.G23, material.G13, material.G12)
    compliance = np.diag(1.0 / np.array([*moduli, *shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        compliance[i, j] = compliance[j, i] = -ratio / moduli[i]
    return compliance


def transverse_ratio(material: material_forms.TransverselyIsotropic) -> float:
    """Return Poisson's ratio across the fibres; ValueError unless one of nu_transverse, G_transverse alone is given."""
    ratio, shear = material.nu_transverse, material.G_transverse
    if ratio is not None and shear is None:
        return ratio
    if shear is not None and ratio is None:
        return material.E_transverse / (2.0 * shear) - 1.0
    raise ValueError(f"nu_transverse, G_transverse: {'missing' if ratio is None else 'both given'}; expected one")


def _numbers(*constants: float | None) -> list[float]:
    """Return the constants, with NaN for each missing constant."""
    return [np.nan if constant is None else constant for constant in constants]


def contrast_lines(materials: Mapping[str, material_forms.Material], plane: str) -> tuple[list[str], list[str]]:
    """Return faults and warnings about contrasts of stiffness or conductivity.  Raises ValueError as `stiffness_of`."""
    noun = "conductivities" if voigt.PLANE_STATES[plane].is_scalar else "stiffnesses"
    with np.errstate(over="ignore"):
        sizes = {phase: float(np.abs(stiffness_of(material, plane)).max()) for phase, material in materials.items()}
    stiffest, softest = max(sizes, key=sizes.__getitem__), min(sizes, key=sizes.__getitem__)
    phases = ", ".join(f"[material.{wording.toml_key(phase)}]" for phase in (stiffest, softest))
    contrast = sizes[stiffest] / sizes[softest]
    if contrast > LARGEST_CONTRAST:
        words = f"{noun} that differ by a factor of {contrast:.1e}: expected at most {LARGEST_CONTRAST:g}"
        return [f"{phases}: {words}"], []
    if contrast > WORRYING_CONTRAST:
        words = f"{noun} differ by {contrast:.1e}: rounding may exceed the tolerance of the checks"
        return [], [f"{phases}: {words}"]
    return [], []
