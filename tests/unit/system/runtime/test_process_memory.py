"""The peak of resident memory begins anew."""

import os
from pathlib import Path

import numpy as np
import pytest

from feti_homog.system.runtime import process_memory

LARGE = 100 * 2**20  # bytes


@pytest.mark.skipif(not os.access(process_memory.CLEAR_REFS, os.W_OK), reason="the system does not let it")
def test_a_peak_is_forgotten():
    process_memory.forget_peak()
    before = process_memory.peak()
    block = np.ones(LARGE // 8)
    assert process_memory.peak() > before + 0.9 * LARGE
    del block
    assert process_memory.peak() > before + 0.9 * LARGE
    process_memory.forget_peak()
    assert process_memory.peak() < before + 0.5 * LARGE


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_freed_bytes_stay_if_they_are_few():
    process_memory.forget_peak()
    before = resident()
    blocks = [np.ones(10_000) for _ in range(LARGE // 80_000)]
    blocks = blocks[::100]  # between which the others are freed
    assert process_memory.spare() > 0.9 * LARGE
    process_memory.forget_peak(kept=2**40)
    assert resident() > before + 0.8 * LARGE
    process_memory.forget_peak()
    assert resident() < before + 0.5 * LARGE


def test_a_peak_that_cannot_be_forgotten_stays(tmp_path):
    before = process_memory.peak()
    process_memory.forget_peak(tmp_path / "none" / "clear_refs")
    assert process_memory.peak() >= before
