"""Results of every kind, computed once."""

from __future__ import annotations

import pytest
from support.verified_results import write


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """kind -> folder of a result, computed when first asked for."""
    folders = {}

    def folder(kind):
        if kind not in folders:
            folders[kind] = write(kind, tmp_path_factory.mktemp(kind) / "result")
        return folders[kind]

    return folder
