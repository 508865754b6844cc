"""Random cases of every kind of analysis obey every law; of what did not converge, those that do not depend on it."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from support.random_results import random_document, random_mixed_document

from feti_homog import Case, run
from feti_homog.verification.certificate import verify

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", [1, 3, 5, 6, 10, 15])
def test_random_cases_obey_every_law(tmp_path, seed):
    case = Case.parse(random_document(np.random.default_rng(seed)))
    run(case, MPI.COMM_SELF, out=tmp_path)
    certificate = verify(tmp_path)
    assert certificate.holds, certificate.text


@pytest.mark.parametrize("seed", [2, 6, 9])
def test_random_paths_of_mixed_loads_obey_every_law(tmp_path, seed):
    case = Case.parse(random_mixed_document(np.random.default_rng(seed)))
    run(case, MPI.COMM_SELF, out=tmp_path)
    certificate = verify(tmp_path)
    assert certificate.holds, certificate.text
