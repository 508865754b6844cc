"""Evaluate bond laws by independent formulas, and select the law at interface nodes.

A law is a class, here or in `softening`, with the name that `case/bond_laws.py` lists.  Tractions (k, c) have a normal
and a tangential component, and for c = 3 an axial one: t_n, t_t, t_a.  <t_i> is the magnitude of component i, but 0 for
a normal compression; R_i is its strength, k_i its stiffness.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from feti_homog.case import bond_laws
from feti_homog.typing import AnyInt, Bool, Float, Int
from feti_homog.verify.reading import ResultFiles, State

# Keys of a section that have one number; each maps to the key that provides its default, if any.
NUMBERS = {
    "normal_stiffness": "", "tangential_stiffness": "", "axial_stiffness": "tangential_stiffness",
    "normal_strength": "", "tangential_strength": "", "axial_strength": "tangential_strength",
    "toughness": "", "normal_toughness": "", "tangential_toughness": "", "mode_sensitivity": "", "mixing_exponent": "",
}  # fmt: skip


class BondLaw(ABC):
    """The law of k bonds.  Numbers in its `section`, an [[interface]], are scalars or (k,).

    If `has_toughness`, breaks dissipate the energy `absorbed`; if `has_tips`, result.json has energies at crack tips.
    """

    has_toughness: ClassVar[bool] = False
    has_tips: ClassVar[bool] = False

    def __init__(self, section: Mapping[str, Any]) -> None:
        self.section = section

    @property
    def grows_by_release(self) -> bool:
        """Return whether bonds at tips break by energy release, which the fields do not determine."""
        return bool(self.section.get("growth") == "released")

    @abstractmethod
    def utilisation(self, traction: Float) -> Float:
        """Compute utilisations (k,) of the strength: 1 at a break, 0 under pure compression.  Tractions are (k, c)."""

    @abstractmethod
    def breaks(self, traction: Float) -> dict[str, float]:
        """Return the numbers of a break under the traction (1, c), with their keys in envelope points."""

    def jumps(self, traction: Float) -> Float:
        """Compute the jumps (k, c) of elastic bonds: traction / stiffness."""
        return np.asarray(traction / self._components("stiffness", traction))

    def mode(self, traction: Float) -> Float:
        """Compute modes psi (k,), 0 to pi/2: tan^2 psi = G_II / G_I with toughness, else (t_t^2 + t_a^2) / <t_n>^2."""
        pulls = np.sqrt(self.energies(traction)) if self.has_toughness else pulled(traction)
        return np.asarray(np.arctan2(np.sqrt(np.square(pulls[:, 1:]).sum(axis=1)), pulls[:, 0]))

    def lost(self, psi: Float) -> Float:
        """Return the fracture energies per area (k,) in modes psi (k,): 0, except in `SpringEnergy`."""
        return np.zeros(len(psi))

    def absorbed(self, psi: Float, before: Float, after: Float) -> Float:
        """Compute energies per area (k,) absorbed in modes psi as damage rises; for elastic bonds, `lost` in breaks."""
        return self.lost(psi)

    def absorbed_range(self, before: Float, after: Float) -> tuple[Float, Float]:
        """Compute lower and upper bounds, both (k,), of `absorbed` over all modes."""
        low, high = (self.lost(np.full(len(after), psi)) for psi in (0.0, np.pi / 2))
        return low, high

    def onset(self, traction: Float) -> Float:
        """Compute the utilisation (k,) of intact bonds: 1 at a break or first damage."""
        return self.utilisation(traction)

    def energies(self, traction: Float) -> Float:
        """Compute bond energies per area (k, 2): G_I = <t_n>^2 / (2 k_n), G_II = t_t^2 / (2 k_t) + t_a^2 / (2 k_a)."""
        energies = pulled(traction) ** 2 / (2 * self._components("stiffness", traction))
        return np.column_stack([energies[:, 0], energies[:, 1:].sum(axis=1)])

    def shares(self, traction: Float) -> Float:
        """Compute the ratios <t_i> / R_i (k, c) of traction components to strengths."""
        return np.asarray(pulled(traction) / self._components("strength", traction))

    def _components(self, kind: str, traction: Float) -> Float:
        """Return stiffnesses or strengths (`kind`), (c,) or (k, c); inf if missing, axial ones as tangential ones."""
        normal, tangential = (self.section.get(f"{name}_{kind}", np.inf) for name in ("normal", "tangential"))
        components = normal, tangential, self.section.get(f"axial_{kind}", tangential)
        stacked = np.stack(np.broadcast_arrays(*(np.asarray(value, float) for value in components)), axis=-1)
        return np.asarray(stacked[..., : traction.shape[1]])


class MaxStrength(BondLaw):
    """The law of the largest ratio: max_i <t_i> / R_i = 1 breaks the bond."""

    def utilisation(self, traction: Float) -> Float:
        """Compute the utilisation max_i <t_i> / R_i (k,)."""
        return np.asarray(self.shares(traction).max(axis=1, initial=0.0))

    def breaks(self, traction: Float) -> dict[str, float]:
        """Return the ratios <t_i> / R_i under the keys "normal", "tangential" and, for c = 3, "axial"."""
        return dict(zip(("normal", "tangential", "axial"), self.shares(traction)[0].tolist(), strict=False))


class QuadraticStrength(MaxStrength):
    """The quadratic law: sum_i (<t_i> / R_i)^2 = 1 breaks the bond."""

    def utilisation(self, traction: Float) -> Float:
        """Compute the utilisation sqrt(sum_i (<t_i> / R_i)^2) (k,)."""
        return np.asarray(np.sqrt(np.square(self.shares(traction)).sum(axis=1)))


class SpringEnergy(BondLaw):
    """The energy law: a bond breaks at G_I + G_II = G_Ic [1 + tan^2((1 - lambda) psi)], lambda = mode_sensitivity."""

    has_toughness: ClassVar[bool] = True
    has_tips: ClassVar[bool] = True

    def utilisation(self, traction: Float) -> Float:
        """Compute the utilisation sqrt((G_I + G_II) / G_c) (k,), see `energies` and `lost`."""
        return np.asarray(np.sqrt(self.energies(traction).sum(axis=1) / self.lost(self.mode(traction))))

    def lost(self, psi: Float) -> Float:
        """Compute the toughness G_c (k,), energy per area, in modes psi (k,)."""
        angle = (1 - np.asarray(self.section["mode_sensitivity"], float)) * psi
        return np.asarray(np.asarray(self.section["toughness"], float) * (1 + np.tan(angle) ** 2))

    def breaks(self, traction: Float) -> dict[str, float]:
        """Return the mode psi in degrees under the key "psi"."""
        return {"psi": float(np.degrees(self.mode(traction))[0])}


def pulled(traction: Float) -> Float:
    """Compute <t_i> (k, c): magnitudes of traction components, 0 for a normal compression."""
    return np.column_stack([np.maximum(traction[:, 0], 0.0), np.abs(traction[:, 1:])])


def law_of(section: Mapping[str, Any]) -> BondLaw:
    """Construct the law that `criterion` in a section [[interface]] names; without this key, the default law."""
    module, name = bond_laws.LAWS[section.get("criterion", bond_laws.DEFAULT)].implementation.split(".")
    implementations = import_module(f"{__package__}.{module if module == 'softening' else 'bonds'}")
    law: BondLaw = getattr(implementations, name)(section)
    return law


def law_at(files: ResultFiles, nodes: AnyInt | Bool | slice = slice(None), damage: Float | None = None) -> BondLaw:
    """Return the bond law at `nodes`, p of the k interface nodes.

    `damage` (k,), if not None, softens the law.  With several sections or scattered strengths, the constants are (p,).
    """
    sections, strength = files.interfaces, files.fibres.strength
    section = {**sections[0]} if sections else {}
    if sections and (len(sections) > 1 or (strength != 1).any()):
        pair, factor = files.interface.pair[nodes], strength[files.interface.fibre[nodes] - 1]
        for name, default in NUMBERS.items():
            power = {"strength": 1, "toughness": 2}.get(name.rpartition("_")[2], 0)
            entries = [table.get(default) if table.get(name) is None else table[name] for table in sections]
            numbers = np.array([np.inf if entry is None else float(entry) for entry in entries])
            section[name] = numbers[pair] * factor**power
    return law_of(section if damage is None else section | {"damage": damage[nodes]})


def friction_at(files: ResultFiles, on_damage: bool = False) -> Float:
    """Return the friction coefficients (k,) of debonded faces or, if `on_damage`, of damaged bonds."""
    key = "friction_on_damage" if on_damage else "friction"
    mu = [float(section.get("friction", 0.0)) if section.get(key) else 0.0 for section in files.interfaces or [{}]]
    return np.asarray(np.array(mu)[np.minimum(files.interface.pair, len(mu) - 1)])


def rubbing_force(files: ResultFiles, state: State) -> Float:
    """Compute the friction traction (k,) on the damaged fraction of unbroken bonds, 0 elsewhere.

    It is t - g / (C - C_0) with shear traction t, slip C_0 t + g, and compliances C_0 (intact) and C (damaged).
    """
    unit, intact_bonds = np.ones_like(state.traction), np.zeros(len(state.damage))
    intact, damaged = (law_at(files, damage=damage).jumps(unit)[:, 1] for damage in (intact_bonds, state.damage))
    rubs = (state.status == 0) & (damaged > intact) & (friction_at(files, on_damage=True) > 0.0)
    g = state.jump[:, 1] - intact * state.traction[:, 1]
    return np.where(rubs, state.traction[:, 1] - g / np.where(rubs, damaged - intact, 1.0), 0.0)


def cohesive_traction(files: ResultFiles, state: State) -> Float:
    """Compute the tractions (k, c) without the friction on damaged fractions."""
    traction = state.traction.copy()
    traction[:, 1] -= state.damage * rubbing_force(files, state)
    return traction


def pairs_of(files: ResultFiles) -> Int:
    """Return the section numbers (phases, phases) of pairs of phases.  They are -1 where bonds never part."""
    pairs = np.full((len(files.phases),) * 2, -1)
    for number, section in enumerate(files.interfaces or [{}]):
        if "between" not in section:
            pairs[0, 1:] = pairs[1:, 0] = number
        else:
            first, second = (files.phases.index(name) for name in section["between"])
            pairs[first, second] = pairs[second, first] = number
    return pairs
