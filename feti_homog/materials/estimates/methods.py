"""All estimates by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from feti_homog.materials.estimates.constituents import NOTHING, Estimate, Estimates, Fibres
from feti_homog.materials.estimates.cylinders import composite_cylinders, mori_tanaka
from feti_homog.materials.estimates.mixtures import chamis, halpin_tsai, rule_of_mixtures
from feti_homog.materials.estimates.self_consistent import self_consistent
from feti_homog.materials.spatial_constants import TransverselyIsotropic, is_transversely_isotropic

METHODS: Mapping[str, Callable[[TransverselyIsotropic, Sequence[Fibres]], Estimate]] = {
    "rule_of_mixtures": rule_of_mixtures,
    "chamis": chamis,
    "halpin_tsai": halpin_tsai,
    "mori_tanaka": mori_tanaka,
    "composite_cylinders": composite_cylinders,
    "self_consistent": self_consistent,
}


def estimates(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimates:
    """Return the estimates of each method for fibres in a matrix.

    The rule of mixtures and Mori and Tanaka's estimate are defined for any kinds of fibres, the others for one; on
    springs the last three.  No method says anything if a phase is not transversely isotropic about x3, and none says
    anything of expansions if a phase has none.
    """
    if not all(map(is_transversely_isotropic, [matrix, *(family.constants for family in fibres)])):
        return Estimates(**dict.fromkeys(METHODS, NOTHING))
    return Estimates(**{name: method(matrix, fibres) for name, method in METHODS.items()})
