"""A change selects the tests that import what it changed, also through other modules of the tests."""

import pytest
from changed_tests import module_name, touched


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("feti_homog/mesh/submeshes.py", "feti_homog.mesh.submeshes"),
        ("feti_homog/mesh/__init__.py", "feti_homog.mesh"),
        ("tests/support/cases.py", "support.cases"),
        ("scripts/mutations.py", "mutations"),
    ],
)
def test_modules_have_the_names_of_imports(path, name):
    assert module_name(path) == name


def test_tests_are_selected_through_their_modules():
    assert touched({"scripts/changed_tests.py"}) == ["tests/unit/scripts/test_changed_tests.py"]
    assert touched({"tests/differential/finer_meshes.py"}) == ["tests/unit/test_differential.py"]
    assert touched({"README.md", "tests/unit/test_differential.py"}) == ["tests/unit/test_differential.py"]
