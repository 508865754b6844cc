"""Law that breaks the bonds of a case, with what it needs of the solver."""

from __future__ import annotations

from feti_homog.errors import CaseError
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.laws.energy import ReleasedEnergy, SpringEnergy


def criterion_of(cell: TornCell, grows: bool = False) -> BondLaw:
    """Law of the bonds of a cell, in which debonding that `grows` makes tips of its own.  Collective.

    Raises:
        CaseError: tips of debonding ask for what the solver does not have.
    """
    bonds = cell.case.interfaces
    law = cell.bond_law if grows else cell.bond_law.onset()
    if not (isinstance(law, SpringEnergy) and bonds[0].growth == "released"):
        return law
    has_tips = grows or cell.sum_over_ranks(int(cell.debonded(None).sum())) > 0
    has_tips &= cell.solver.jump_operator.global_rows > 0
    return _at_tips(cell, law) if has_tips else law


def _at_tips(cell: TornCell, springs: SpringEnergy) -> ReleasedEnergy:
    """Raise CaseError if the solver has no inverse of the dual operator."""
    inverses = [each.solver.exact_inverse for each in cell.problems]
    known = [inverse for inverse in inverses if inverse is not None]
    if len(known) < len(inverses):
        raise CaseError('[interface] growth = "released": needs -feti_pc_type influence; or growth = "springs"')
    return ReleasedEnergy.of(springs, *known)
