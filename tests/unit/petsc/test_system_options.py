"""Options of PETSc itself pass; misspelt ones, and such as nothing would read, do not."""

from __future__ import annotations

import pytest

from feti_homog.petsc.system_options import unknown_to_petsc


@pytest.mark.parametrize(
    "name", ["log_view", "malloc_test", "sf_type", "log_view_of_a_release_to_come", "feti_x", "info"]
)
def test_known_names_pass(name):
    assert unknown_to_petsc([name]) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("log_vieww", "did you mean -log_view?"),
        ("options_lef", "did you mean -options_left?"),
        ("mat_type", "options that begin with -feti_"),
        ("prefix_push", "options that begin with -feti_"),
    ],
)
def test_others_are_told(name, words):
    (fault,) = unknown_to_petsc([name])
    assert fault.startswith(f"-{name}: unknown option; ") and words in fault


def test_a_name_without_its_prefix_is_told_elsewhere():
    assert unknown_to_petsc(["ksp_rtol"]) == []
