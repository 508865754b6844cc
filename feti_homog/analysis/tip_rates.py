"""Energy release rates at the tips of debonded arcs, as result.json has them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from feti_homog.analysis.result_records import TipRates
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.energy_release import EnergyReleaseRates
from feti_homog.materials.voigt import STRAINS

EMPTY = np.zeros(0)
# Loads under which energy release rates are known; "strain" is a given one.
IN_PLANE_LOADS = (*STRAINS, "strain")


class TipRateRecorder:
    """Makes the records of debonded arcs in the plane problem."""

    def __init__(self, plane: Homogenization) -> None:
        self._plane = plane

    @cached_property
    def _rates(self) -> EnergyReleaseRates:
        """Collective when first used."""
        return EnergyReleaseRates(self._plane.cell, self._plane.interface)

    def of(self, responses: Sequence[Response], loads: Sequence[str]) -> TipRates:
        """Rates at all tips under each load that has them; none while all is bonded.  Collective."""
        pairs = zip(responses, loads, strict=True)
        found = [
            (self._rates.of(response), load)
            for response, load in pairs
            if load.lstrip("-") in IN_PLANE_LOADS and response.debonded
        ]
        columns = [
            (at.fibre, at.pair, at.direction, at.total, *at.modes.T, at.mode_angle, at.length) for at, _ in found
        ]
        fibre, pair, angle, G, G_I, G_II, psi, length = (
            map(np.concatenate, zip(*columns, strict=True)) if found else [EMPTY] * 8
        )
        several = len(self._plane.cell.case.interfaces) > 1
        return TipRates(
            load=tuple(load for at, load in found for _ in at.fibre),
            fibre=tuple(fibre.astype(int).tolist()),
            angle=angle,
            G=G,
            G_I=G_I,
            G_II=G_II,
            psi=psi,
            length=length,
            interface=tuple((pair + 1).astype(int).tolist()) if several else None,
        )
