"""Stresses are those that the case asks for, relative to the load: a strain that came out is no scale of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.verify.check_loads import Prescribed, check_loads
from feti_homog.verify.findings import Findings, checks


@pytest.mark.parametrize(("strain", "missed", "holds"), [(0.01, 0.0, True), (1e7, 0.0, True), (1e7, 5e-4, False)])
def test_a_stress_that_is_missed_is_measured_by_the_load(strain, missed, holds):
    load = Prescribed(np.array([-0.001, 0.0, 0.008]), np.array([False, True, True]))
    strains, stresses = np.array([-0.001, 0.0, strain]), np.array([-0.004, 0.0, 0.008 - missed])
    state = SimpleNamespace(name="a state", point=0, strain=strains, mean_stress=stresses, temperature=0.0)
    cell = SimpleNamespace(
        files=SimpleNamespace(document={}),
        reuss=np.diag([4.0, 4.0, 1.0]),
        largest_strain=strain,
        loads=lambda strain, temperature: strain,
    )
    findings = Findings(checks(1e-8, False, has_coatings=False))
    check_loads(findings, cell, [state], [(load, {})])
    assert all(finding.holds for finding in findings.worst()) is holds
