"""A NumPy that something else installed is found by its major version."""

import pytest
from check_modules import numpy_fault


@pytest.mark.parametrize(
    ("installed", "fault"), [("1.26.4", ""), ("1.24.2", ""), ("2.3.5", "version 2.3.5: petsc4py was built for 1.26.4")]
)
def test_numpy_of_another_major_version_is_a_fault(installed, fault):
    assert numpy_fault("numpy==1.26.4\n", installed) == fault
