"""Bounds of the constants of fibres in a matrix that hold for any arrangement, isotropic across the fibres."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from feti_homog.materials.estimates.constituents import FibreBounds
from feti_homog.materials.estimates.cylinders import Surroundings, aligned_cylinders
from feti_homog.materials.spatial_constants import TransverselyIsotropic


def fibre_bounds(fractions: Sequence[float], phases: Sequence[TransverselyIsotropic]) -> FibreBounds:
    """Bounds of bonded, transversely isotropic phases that are cylinders along x3 of any section.

    `aligned_cylinders` with the least moduli of the phases around, and with the greatest.  Those of nu_A are the values
    of Hill's relation at the bounds of k, so of two phases only.  All but those of G_T hold for square symmetry too.
    Hill 1964, Hashin 1965, Walpole 1969.
    """
    lower, upper = (aligned_cylinders(fractions, phases, _extreme(phases, pick)) for pick in (min, max))
    nu = min(lower.nu_axial, upper.nu_axial), max(lower.nu_axial, upper.nu_axial)
    return FibreBounds(
        E_axial=(lower.E_axial, upper.E_axial),
        nu_axial=nu if len(phases) == 2 else None,
        G_axial=(lower.G_axial, upper.G_axial),
        G_transverse=(lower.G_transverse, upper.G_transverse),
        K_transverse=(lower.K_transverse, upper.K_transverse),
    )


def _extreme(phases: Sequence[TransverselyIsotropic], pick: Callable[[Iterable[float]], float]) -> Surroundings:
    """Return the least or the greatest of each modulus."""
    return Surroundings(
        pick(phase.K_transverse for phase in phases),
        pick(phase.G_transverse for phase in phases),
        pick(phase.G_axial for phase in phases),
    )
