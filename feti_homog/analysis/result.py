"""What a case comes to, as arrays: the answer to a program that asks for it in Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.typing import Float


@dataclass(frozen=True)
class Result:
    """The result of a case, the same on every rank; stresses in the unit of the moduli, order [11, 22, 12].

    Attributes:
        effective_stiffness: (3, 3) L^ef, its columns the stresses under the unit strains; None for
            analyses other than "stiffness".
        effective_stiffness_compression: (3, 3) the same under minus the unit strains, where debonded faces touch
            without tension; else None.
        moduli: engineering moduli by name (`E1`, `G12`, `bulk`, `shear`, ...); empty for debonded cells.
        bounds: `voigt` and `reuss`, (3, 3), and `hashin_shtrikman`, bounds of `bulk` and `shear` or None; as `moduli`.
        points: by name, arrays over the n points of an "angle" or a "path": `angle` or `load_factor` (n,),
            `strain` and `stress` (n, 3), `stiffness` (n, 3, 3), `bonded`, `open`, `closed`, ... (n,); else empty.
        checks: largest relative error of each law.
        document: all of result.json.
    """

    effective_stiffness: Float | None
    effective_stiffness_compression: Float | None
    moduli: Mapping[str, float]
    bounds: Mapping[str, Any]
    points: Mapping[str, NDArray[Any]]
    checks: Mapping[str, float]
    document: Mapping[str, Any]

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Result:
        """The result of a document as result.json has it."""
        points = document.get("angle") or document.get("path") or [{}]
        return cls(
            effective_stiffness=_matrix(document.get("effective_stiffness")),
            effective_stiffness_compression=_matrix(document.get("effective_stiffness_compression")),
            moduli=document.get("moduli", {}),
            bounds=document.get("bounds", {}),
            points={name: np.array([point[name] for point in points]) for name in points[0]},
            checks=document["checks"],
            document=document,
        )


def _matrix(value: Any) -> Float | None:
    return None if value is None else np.asarray(value, dtype=float)
