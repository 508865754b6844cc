"""The tensor of a strain in Voigt order."""

import numpy as np

from feti_homog.materials.voigt import strain_tensor


def test_the_tensor_has_half_of_the_engineering_shear():
    np.testing.assert_array_equal(strain_tensor(np.array([1.0, 2.0, 3.0])), [[1.0, 1.5], [1.5, 2.0]])
