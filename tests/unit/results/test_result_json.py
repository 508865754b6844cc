import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feti_homog.errors import FetiHomogError
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
