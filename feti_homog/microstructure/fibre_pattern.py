"""Round fibres in a rectangle, which is a periodic cell or a window of something larger."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil, fsum, pi

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class FibrePattern:
    """Discs with centres within the rectangle [0, width] x [0, height].

    Attributes:
        width, height: of the rectangle.
        centres, radii: (N, 2) and (N,) of the discs.
        periodic: whether what leaves the rectangle on one side returns on the other; otherwise it is a window, of whose
            surroundings nothing is known.
    """

    width: float
    height: float
    centres: Float
    radii: Float
    periodic: bool

    @property
    def size(self) -> Float:
        """(2,) width and height."""
        return np.array([self.width, self.height])

    @property
    def area(self) -> float:
        """Area of the rectangle."""
        return self.width * self.height

    @property
    def count(self) -> int:
        """N."""
        return len(self.radii)

    @property
    def mean_radius(self) -> float:
        """Mean radius."""
        return fsum(self.radii) / self.count

    @property
    def fibre_fraction(self) -> float:
        """sum_i pi R_i^2 / area over the centres in the rectangle.

        Of a window unbiased, for what leaves it is met, in the mean, by what comes in.
        """
        return pi * fsum(self.radii * self.radii) / self.area

    @property
    def nearest_side(self) -> Float:
        """(N,) distance of each centre to the sides of the window; infinite in a periodic cell."""
        if self.periodic:
            return np.full(self.count, np.inf)
        return np.asarray(np.minimum(self.centres, self.size - self.centres).min(axis=1))

    @cached_property
    def wrapped(self) -> Float:
        """(N, 2) centres within [0, width) x [0, height)."""
        inside = self.centres % self.size
        return np.asarray(np.where(inside < self.size, inside, 0.0))

    def images(self, reach: float) -> tuple[Float, Int]:
        """(m, 2) the centres, first the N of the rectangle, then their images nearer to it than `reach`; owners."""
        own = np.arange(self.count)
        if not self.periodic:
            return self.centres, own
        steps = [range(-n, n + 1) for n in (ceil(reach / length) for length in self.size)]
        shifts = np.array([step for step in product(*steps) if any(step)], dtype=float).reshape(-1, 2) * self.size
        found = self.wrapped + shifts[:, None]
        shift, owner = np.nonzero(np.all((found > -reach) & (found < self.size + reach), axis=2))
        return np.concatenate([self.wrapped, found[shift, owner]]), np.concatenate([own, owner])

    @cached_property
    def smallest_gap(self) -> float:
        """Smallest distance between the circles of two fibres, or of one and its image; infinite without pairs."""
        if not self.periodic and self.count == 1:
            return np.inf
        tree = cKDTree(self.images(float(self.size.min()))[0])
        nearest = tree.query(tree.data[: self.count], 2)[0][:, 1].min()
        points, owner = self.images(reach := float(nearest + 2 * np.ptp(self.radii)) * (1 + 1e-9))
        pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
        pairs = pairs[pairs[:, 0] < self.count]
        distance = np.hypot(*(points[pairs[:, 1]] - points[pairs[:, 0]]).T)
        return float((distance - self.radii[owner[pairs]].sum(axis=1)).min())

    def pair_vectors(self, reach: float) -> Float:
        """(k, 2) from each centre to every other one at most `reach` away, images and its own among them."""
        points, _ = self.images(reach * (1 + 1e-9))
        own = points[: self.count]
        near = cKDTree(own).sparse_distance_matrix(cKDTree(points), reach, output_type="ndarray")
        near = near[near["i"] != near["j"]]
        return np.asarray(points[near["j"]] - own[near["i"]])
