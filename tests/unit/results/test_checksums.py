"""A document is read as it was written, or not at all; large files are known by size and checksum."""

import json
import zlib

import numpy as np
import pytest

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import result_json

BLOCK = 1000
SIZES = [0, 1, 999, 1000, 1001, 5003]
DOCUMENT = {
    "schema": 1,
    "numbers": [0.1, 1e-300, 3, True, None],
    "unit": "µm",
    "name": "\udcff",
    "table": {"b": 1, "a": 2},
}


def test_documents_are_read_in_any_layout_and_without_a_checksum():
    text = result_json.dumps(DOCUMENT)
    assert result_json.loads(text) == DOCUMENT and list(json.loads(text))[-1] == "checksum"
    assert result_json.dumps(result_json.loads(text)) == text
    assert result_json.loads(json.dumps(DOCUMENT)) == DOCUMENT and result_json.loads("{}") == {}
    assert result_json.loads(json.dumps(json.loads(result_json.dumps(DOCUMENT)))) == DOCUMENT


def test_arrays_and_rows_of_matrices_have_a_line_each():
    points = [{"E": [0.5, None], "S": [[1.0, 2.0], [3, True]], "none": [], "names": ["a", "µ"], "table": {}}]
    text = result_json.dumps({"path": points})
    assert json.loads(text)["path"] == points
    assert text.splitlines()[:-2] == [
        "{", ' "path": [', "  {", '   "E": [0.5, null],', '   "S": [', "    [1.0, 2.0],", "    [3, true]", "   ],",
        '   "none": [],', '   "names": [', '    "a",', '    "µ"', "   ],", '   "table": {}', "  }", " ],",
    ]  # fmt: skip
    with pytest.raises(ValueError):
        result_json.dumps({"path": [[1.0, float("nan")]]})


def test_a_line_for_each_number_as_older_versions_wrote_is_read():
    text = json.dumps(DOCUMENT, indent=1, ensure_ascii=False)
    checksum = f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}"
    old = text.removesuffix("\n}") + f',\n "checksum": "{checksum}"\n}}\n'
    assert result_json.loads(old) == DOCUMENT
    with pytest.raises(ValueError, match="its checksum is wrong"):
        result_json.loads(old.replace("0.1", "0.2"))


def test_every_changed_number_or_letter_is_reported():
    text = result_json.dumps(DOCUMENT)
    for place, letter in enumerate(text):
        if letter.isalnum():
            with pytest.raises(ValueError):
                result_json.loads(text[:place] + ("7" if letter != "7" else "8") + text[place + 1 :])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[",
        "[]",
        "3",
        "[" * 100_000,
        f'{{"a": {"[" * 600}{"]" * 600}, "checksum": "0"}}',
        '{"a": 1',
        '{"a": 1, "checksum": "0"}',
        '{"checksum": 1}',
    ],
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError):
        result_json.loads(text)


@pytest.mark.parametrize("size", SIZES)
def test_the_checksum_is_that_of_the_blocks(tmp_path, size):
    content = np.random.default_rng(size).bytes(size)
    (tmp_path / "file").write_bytes(content)
    found = result_json.seal(tmp_path / "file", BLOCK)
    blocks = [zlib.crc32(content[k : k + BLOCK]) for k in range(0, size, BLOCK)]
    expected = zlib.crc32(b"".join(block.to_bytes(4, "little") for block in blocks))
    assert found == result_json.FileSeal(size, f"{expected:08x}")
    result_json.check(tmp_path / "file", found, BLOCK)


@pytest.mark.parametrize("size", SIZES[1:])
def test_another_file_is_reported(tmp_path, size):
    path = tmp_path / "file"
    content = bytearray(np.random.default_rng(size).bytes(size))
    path.write_bytes(content)
    found = result_json.seal(path, BLOCK)
    for bit in (0, 4 * size, 8 * size - 1):
        content[bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        with pytest.raises(CaseError, match="damaged, or of another run: its checksum is wrong"):
            result_json.check(path, found, BLOCK)
        content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content[:-1])
    with pytest.raises(CaseError, match=f"it has {size - 1} bytes, not {size}"):
        result_json.check(path, found, BLOCK)


def test_a_file_that_is_gone_is_reported(tmp_path):
    with pytest.raises(FetiHomogError, match=r"cannot read .*none: No such file"):
        result_json.check(tmp_path / "none", result_json.FileSeal(1, ""))
