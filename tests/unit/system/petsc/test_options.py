"""Options of a case below those of the command line, and both as they were afterwards."""

from __future__ import annotations

import pytest
from petsc4py import PETSc

from feti_homog.system.petsc.option_values import petsc_words
from feti_homog.system.petsc.options import case_options


@pytest.fixture
def given():
    """Set an option (name without dash) of the command line, until the test ends."""
    database, names = PETSc.Options(), []

    def give(name, value):
        names.append(name)
        database.setValue(name, value)

    yield give
    for name in names:
        database.delValue(name)


def test_a_case_without_options_on_the_command_line():
    database = PETSc.Options()
    with case_options({"feti_view": True, "feti_ksp_monitor": False, "feti_ksp_rtol": 1e-5}):
        assert database.hasName("feti_view") and not database.hasName("feti_ksp_monitor")
        assert database.getReal("feti_ksp_rtol") == 1e-5
    assert not any(map(database.hasName, ("feti_view", "feti_ksp_monitor", "feti_ksp_rtol")))


def test_the_command_line_comes_first_and_is_there_for_the_next_case(given):
    given("feti_view", "false")
    given("feti_ksp_monitor", "true")
    given("feti_ksp_rtol", "1e-4")
    database = PETSc.Options()
    for _ in range(2):
        with case_options({"feti_view": True, "feti_ksp_monitor": False, "feti_ksp_rtol": 1e-5}):
            assert database.hasName("feti_ksp_monitor") and not database.hasName("feti_view")
            assert database.getReal("feti_ksp_rtol") == 1e-4
        assert database.getAll().items() >= {"feti_view": "false", "feti_ksp_monitor": "true"}.items()


def test_only_flags_of_petsc_itself_are_settled_when_it_starts():
    words = petsc_words({"log_view": "false", "malloc_debug": "true", "feti_view": "false", "feti_pc_type": "lumped"})
    assert words == ["-malloc_debug", "-feti_view", "false", "-feti_pc_type", "lumped"]
