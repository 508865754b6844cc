"""The peak of resident memory begins anew."""

from __future__ import annotations

import os

import numpy as np
import pytest

from feti_homog import heap

LARGE = 100 * 2**20  # bytes


@pytest.mark.skipif(not os.access(heap.CLEAR_REFS, os.W_OK), reason="the system does not let it")
def test_a_peak_is_forgotten():
    heap.forget_peak()
    before = heap.peak()
    block = np.ones(LARGE // 8)
    assert heap.peak() > before + 0.9 * LARGE
    del block
    assert heap.peak() > before + 0.9 * LARGE
    heap.forget_peak()
    assert heap.peak() < before + 0.5 * LARGE


def test_a_peak_that_cannot_be_forgotten_stays(monkeypatch, tmp_path):
    monkeypatch.setattr(heap, "CLEAR_REFS", tmp_path / "none" / "clear_refs")
    before = heap.peak()
    heap.forget_peak()
    assert heap.peak() >= before
