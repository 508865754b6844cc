"""Input blocks of MOOSE's solid mechanics.

ComputeElasticityTensor takes C_ijkl: of `symmetric9` in the order 1111 1122 1133 2222 2233 3333 2323 1313 1212, of
`symmetric21` the upper triangle by rows in the order [11, 22, 33, 23, 13, 12].  ComputeEigenstrain takes the
components 11, 22, 33, 23, 13, 12 of a tensor, so half of the engineering shears.
"""

from __future__ import annotations

from collections.abc import Iterable

from feti_homog.report.cards.effective_material import EffectiveMaterial, comments, identifier, number

SYMMETRIC9 = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2), (3, 3), (4, 4), (5, 5))
SYMMETRIC21 = tuple((row, column) for row in range(6) for column in range(row, 6))


def text(material: EffectiveMaterial) -> str:
    """Return the card: a block [Materials]."""
    name, C = identifier(material.name), material.stiffness
    method, entries = ("symmetric9", SYMMETRIC9) if material.is_orthotropic else ("symmetric21", SYMMETRIC21)
    lines = [*comments(material, "#"), "[Materials]"]
    lines += _block(
        f"{name}_elasticity",
        type="ComputeElasticityTensor",
        fill_method=method,
        C_ijkl=_quoted(C[i, j] for i, j in entries),
    )
    if material.expansion is not None:
        lines += ["  # The name of the expansion belongs in eigenstrain_names of the strain."]
        lines += _block(
            f"{name}_temperature_rise",
            type="ParsedMaterial",
            property_name=f"{name}_temperature_rise",
            coupled_variables="'temperature'",
            constant_names="'stress_free_temperature'",
            constant_expressions="'0'",
            expression="'temperature - stress_free_temperature'",
        )
        lines += _block(
            f"{name}_expansion",
            type="ComputeEigenstrain",
            eigen_base=_quoted(material.expansion * [1.0, 1.0, 1.0, 0.5, 0.5, 0.5]),
            prefactor=f"{name}_temperature_rise",
            eigenstrain_name=f"{name}_expansion",
        )
    return "\n".join([*lines, "[]"])


def _block(name: str, **parameters: str) -> list[str]:
    return [f"  [{name}]", *(f"    {key} = {value}" for key, value in parameters.items()), "  []"]


def _quoted(values: Iterable[float]) -> str:
    return f"'{' '.join(number(value) for value in values)}'"
