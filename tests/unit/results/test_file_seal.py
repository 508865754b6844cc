"""Large files are known by size and checksum."""

from __future__ import annotations

import zlib

import numpy as np
import pytest

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import file_seal

BLOCK = 1000
SIZES = [0, 1, 999, 1000, 1001, 5003]


@pytest.mark.parametrize("size", SIZES)
def test_the_checksum_is_that_of_the_blocks(tmp_path, size):
    content = np.random.default_rng(size).bytes(size)
    (tmp_path / "file").write_bytes(content)
    found = file_seal.seal(tmp_path / "file", BLOCK)
    blocks = [zlib.crc32(content[k : k + BLOCK]) for k in range(0, size, BLOCK)]
    expected = zlib.crc32(b"".join(block.to_bytes(4, "little") for block in blocks))
    assert found == file_seal.FileSeal(size, f"{expected:08x}")
    file_seal.check(tmp_path / "file", found, BLOCK)


@pytest.mark.parametrize("size", SIZES[1:])
def test_another_file_is_told(tmp_path, size):
    path = tmp_path / "file"
    content = bytearray(np.random.default_rng(size).bytes(size))
    path.write_bytes(content)
    found = file_seal.seal(path, BLOCK)
    for bit in (0, 4 * size, 8 * size - 1):
        content[bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        with pytest.raises(CaseError, match="damaged, or of another run: its checksum is wrong"):
            file_seal.check(path, found, BLOCK)
        content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content[:-1])
    with pytest.raises(CaseError, match=f"it has {size - 1} bytes, not {size}"):
        file_seal.check(path, found, BLOCK)


def test_a_file_that_is_gone_is_told(tmp_path):
    with pytest.raises(FetiHomogError, match=r"cannot read .*none: No such file"):
        file_seal.check(tmp_path / "none", file_seal.FileSeal(1, ""))
