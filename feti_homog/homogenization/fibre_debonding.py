"""Debonded parts of the fibres' interfaces."""

from __future__ import annotations

import numpy as np

from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.states import BONDED, Status
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float


class FibreInterfaces:
    """The interfaces of the f fibres of a cell, in the order of their numbers; a coated fibre may have two.

    A node stands for its tributary length; so does a debonded one.
    """

    def __init__(self, cell: TornCell) -> None:
        """Sum the lengths of all interfaces.  Collective."""
        self._comm, self._nodes = cell.comm, cell.solver.jump_operator.nodes
        self._fibres, self._pairs = cell.summary.fibres, len(cell.case.interfaces)
        self._fibre = cell.summary.fibre_number(self._nodes.fibre) - 1
        self._length = self._sums(self._nodes.length)
        of_coating = self._sums(self._nodes.length * ~cell.summary.is_fibre[self._nodes.fibre])
        radius = np.where(of_coating > 0, np.nan, cell.summary.radii[cell.summary.fibre_bodies])
        round_fibre = np.degrees(1.0 / np.where(np.isnan(radius), 1.0, radius))
        self._degrees = np.where(np.isnan(radius), 360.0 / np.where(self._length > 0, self._length, 1.0), round_fibre)

    def debonded_length(self, status: Status) -> Float:
        """(f,) debonded length of each fibre's interface, for the states (k,) of this rank's nodes.  Collective."""
        return self._sums(self._nodes.length * (status != BONDED))

    def damaged_length(self, damage: Float) -> Float:
        """(f,) length of each fibre's interface that is damaged, but holds; `damage` (k,) is 1 of broken bonds.

        Collective.
        """
        return self._sums(self._nodes.length * ((damage > 0.0) & (damage < 1.0)))

    def loose(self, status: Status) -> list[int]:
        """Numbers, from 1, of the fibres of which no bond holds.  Collective."""
        held = self._sums(self._nodes.length * (status == BONDED))
        return [int(number) for number in np.flatnonzero((held == 0.0) & (self._length > 0.0)) + 1]

    def angle(self, length: Float) -> Float:
        """(f,) degrees of arc of lengths (f,).

        Of a fibre that is not round, or whose coating has an interface too, 360 times the share of its interfaces.
        """
        return np.asarray(length * self._degrees)

    def share(self, length: Float) -> float:
        """Return the share of lengths (f,) in all interfaces."""
        return float(length.sum() / (self._length.sum() or 1.0))

    def shares(self, status: Status) -> Float:
        """(i,) debonded share of the length of the interfaces of each section [[interface]].  Collective."""
        whole, debonded = (
            np.bincount(self._nodes.pair, values, self._pairs).astype(float)
            for values in (self._nodes.length, self._nodes.length * (status != BONDED))
        )
        whole = allreduce_sum(self._comm, whole)
        return np.asarray(allreduce_sum(self._comm, debonded) / np.where(whole > 0, whole, 1.0))

    def _sums(self, values: Float) -> Float:
        sums: Float = np.bincount(self._fibre, values, self._fibres).astype(float)
        return allreduce_sum(self._comm, sums)
