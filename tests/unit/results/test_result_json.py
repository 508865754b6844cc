"""Read result.json exactly as it was written, or refuse it; recognize large files by size and checksum."""

import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import result_json

SCHEMA = {"schema": result_json.SCHEMA}


def test_numpy_tuples_and_paths_become_json(tmp_path: Path) -> None:
    document = SCHEMA | {
        "matrix": np.array([[1.5, 2.0], [3.0, 4.0]]),
        "count": np.int64(7),
        "flag": np.bool_(True),
        "pair": (np.float64(0.1), None),
        "file": Path("a/b.msh"),
        "unit": "µm",
    }
    path = result_json.write(tmp_path, document)
    assert path == tmp_path / "result.json"
    text = path.read_text(encoding="utf-8")
    content = json.loads(text)
    assert list(content)[-1] == "checksum" and len(content.pop("checksum")) == 8
    assert content == SCHEMA | {
        "matrix": [[1.5, 2.0], [3.0, 4.0]],
        "count": 7,
        "flag": True,
        "pair": [0.1, None],
        "file": "a/b.msh",
        "unit": "µm",
    }
    assert "µm" in text and result_json.read(tmp_path)["count"] == 7


def test_floats_keep_all_their_digits(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=100) * 10.0 ** np.arange(-50, 50)
    result_json.write(tmp_path, SCHEMA | {"values": values})
    assert result_json.read(tmp_path)["values"] == values.tolist()


def test_every_number_that_is_not_finite_is_named(tmp_path: Path) -> None:
    stiffness = np.eye(3)
    stiffness[0, 1] = np.nan
    with pytest.raises(FetiHomogError) as caught:
        result_json.write(tmp_path, {"effective_stiffness": stiffness, "checks": {"hill": -np.inf}, "good": 1.0})
    assert caught.value.faults == (
        "result.json: effective_stiffness[0][1] is nan, not a finite number",
        "result.json: checks.hill is -inf, not a finite number",
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [object(), 1j, {1, 2}])
def test_what_json_cannot_hold_is_a_defect(tmp_path: Path, value: Any) -> None:
    with pytest.raises(TypeError, match=r"result\.json: a\.b\[1\] is a"):
        result_json.write(tmp_path, {"a": {"b": [0, value]}})


def test_a_fault_leaves_the_old_file(tmp_path: Path) -> None:
    result_json.write(tmp_path, SCHEMA | {"a": 1})
    with pytest.raises(FetiHomogError):
        result_json.write(tmp_path, {"a": np.nan})
    assert result_json.read(tmp_path) == SCHEMA | {"a": 1}
    result_json.write(tmp_path, SCHEMA | {"a": 2})
    assert result_json.read(tmp_path) == SCHEMA | {"a": 2}
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


def test_missing_folders_are_made_or_reported(tmp_path: Path) -> None:
    result_json.write(tmp_path / "new" / "folder", {})
    assert (tmp_path / "new" / "folder" / "result.json").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(FetiHomogError, match=r"^cannot write .*file/folder/result\.json: Not a directory$"):
        result_json.write(tmp_path / "file" / "folder", {})


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_to_is_reported(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(FetiHomogError, match=r"^cannot write .*result\.json: Permission denied$"):
        result_json.write(tmp_path, {})


def test_a_missing_or_broken_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FetiHomogError, match=r"^cannot read .*result\.json: No such file"):
        result_json.read(tmp_path)
    (tmp_path / "result.json").write_text('{"a": 1')
    with pytest.raises(FetiHomogError, match=r"^cannot read .*result\.json: Expecting"):
        result_json.read(tmp_path)


@pytest.mark.parametrize("text", ["[]", "null", "3", '"done"'])
def test_a_file_that_is_no_table_is_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)
    with pytest.raises(FetiHomogError, match=r"^cannot read .*result\.json: it is damaged"):
        result_json.read(tmp_path)


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
        f'{{"checksum": "", "a": {"[" * 960}{"]" * 960}}}',
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
