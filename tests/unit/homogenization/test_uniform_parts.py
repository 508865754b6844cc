"""Bodies whose stresses are recovered together."""

from __future__ import annotations

import numpy as np
import pytest

from feti_homog.homogenization.uniform_parts import _apart

# Triangles of five bodies: the first two share a vertex, the last is of another material.
CORNERS = np.array([[0, 1, 2], [2, 3, 4], [5, 6, 7], [6, 7, 8], [9, 10, 11], [12, 13, 14]])
BODIES = [np.array(own) for own in ([0], [1], [2, 3], [4], [5])]
MATERIAL = np.array([1, 1, 1, 1, 1, 2])


@pytest.mark.parametrize(
    ("most", "expected"), [(9, [[0], [1, 2, 3, 4], [5]]), (3, [[0], [1, 2, 3], [4], [5]]), (1, [*map(list, BODIES)])]
)
def test_bodies_of_one_material_that_touch_nowhere_are_together(most, expected):
    assert [own.tolist() for own in _apart(BODIES, CORNERS, MATERIAL, most)] == expected
