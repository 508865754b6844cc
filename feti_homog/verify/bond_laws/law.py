"""Law of bonds as checks need it: jumps, utilisation, mode, energy lost."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from feti_homog.case.bond_laws import DEFAULT, LAWS
from feti_homog.typing import Float


class BondLaw(ABC):
    """Law of some bonds, whose section has one number of all or one of each (k,).

    With toughness, breaking bonds take the energy `lost`; with tips, result.json has energies at those of debonding.
    """

    has_toughness: ClassVar[bool] = False
    has_tips: ClassVar[bool] = False

    def __init__(self, section: Mapping[str, Any]) -> None:
        self.section = section

    @property
    def grows_by_release(self) -> bool:
        """Return True if bonds beside broken ones break by what that releases, which is not in the files."""
        return bool(self.section.get("growth") == "released")

    @abstractmethod
    def utilisation(self, traction: Float) -> Float:
        """(k,) share of their strength that tractions (k, 2), or with that along the fibre (k, 3), use.

        Compression uses none.
        """

    @abstractmethod
    def breaks(self, traction: Float) -> dict[str, float]:
        """Return how a traction (1, c) breaks a bond, by the names of an envelope's points."""

    def jumps(self, traction: Float) -> Float:
        """(k, c) what elastic bonds give way: traction / stiffness."""
        return np.asarray(traction / self._components("stiffness", traction))

    def mode(self, traction: Float) -> Float:
        """(k,) psi of tractions (k, c): 0 opens, pi/2 shears."""
        pulls = pulled(traction)
        return np.asarray(np.arctan2(np.sqrt(np.square(pulls[:, 1:]).sum(axis=1)), pulls[:, 0]))

    def lost(self, psi: Float) -> Float:
        """(k,) energies per area that breaks in the modes psi (k,) take."""
        return np.zeros(len(psi))

    def taken(self, psi: Float, before: Float, after: Float) -> Float:
        """(k,) energies per area that bonds take in the modes psi (k,) from the damage `before` to `after`."""
        return self.lost(psi)

    def taken_between(self, before: Float, after: Float) -> tuple[Float, Float]:
        """(k,) the least and the most, whatever the modes."""
        least, most = (self.lost(np.full(len(after), psi)) for psi in (0.0, np.pi / 2))
        return least, most

    def onset(self, traction: Float) -> Float:
        """(k,) utilisation of intact bonds by tractions (k, c), 1 where they break or are first damaged."""
        return self.utilisation(traction)

    def energies(self, traction: Float) -> Float:
        """(k, 2) energies per area of opening and of shear that tractions (k, c) store in the springs."""
        energies = pulled(traction) ** 2 / (2 * self._components("stiffness", traction))
        return np.column_stack([energies[:, 0], energies[:, 1:].sum(axis=1)])

    def shares(self, traction: Float) -> Float:
        """(k, c) what each component uses of its strength."""
        return np.asarray(pulled(traction) / self._components("strength", traction))

    def _components(self, what: str, traction: Float) -> Float:
        """(c,) or (k, c) normal, tangential and axial stiffness or strength; the last is by default the second."""
        normal, tangential = (self.section.get(f"{name}_{what}", np.inf) for name in ("normal", "tangential"))
        components = normal, tangential, self.section.get(f"axial_{what}", tangential)
        whole = np.stack(np.broadcast_arrays(*(np.asarray(value, float) for value in components)), axis=-1)
        return np.asarray(whole[..., : traction.shape[1]])


def pulled(traction: Float) -> Float:
    """(k, c) sizes of the components that count: not of compression."""
    return np.column_stack([np.maximum(traction[:, 0], 0.0), np.abs(traction[:, 1:])])


def law_of(section: Mapping[str, Any]) -> BondLaw:
    """Law that a section [interface] names, the default without one."""
    module, name = LAWS[section.get("criterion", DEFAULT)].implementation.split(".")
    law: BondLaw = getattr(import_module(f"{__package__}.{module}"), name)(section)
    return law
