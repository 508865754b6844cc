"""From the name of a law of bonds in a case to its class."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol

from feti_homog.case.bond_laws import LAWS
from feti_homog.interface.laws.bond_law import BondLaw, KeyValues


class MadeOfKeys(Protocol):
    """Class of a law that the keys of [interface] define."""

    def of_keys(self, value: KeyValues) -> BondLaw:
        """Make the law."""


def law_class(name: str) -> MadeOfKeys:
    """Class of the law with this name in `case.bond_laws`."""
    module, cls = LAWS[name].implementation.split(".")
    found: MadeOfKeys = getattr(import_module(f"{__package__}.{module}"), cls)
    return found
