"""A folder without a result that can be read is reported in one line, whatever is wrong with it."""

import json

import h5py
import pytest
from support.verified_results import falsified, write

from feti_homog.cli import main
from feti_homog.errors import CaseError
from feti_homog.verify.certificate import verify


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return write("plane", tmp_path_factory.mktemp("plane") / "result")


def cut(name, share):
    def damage(folder):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])

    return damage


def foreign(folder):
    with h5py.File(folder / "result.h5", "w") as file:
        file["something"] = [1, 2, 3]


def without(*names):
    def damage(folder):
        with h5py.File(folder / "result.h5", "r+") as file:
            for name in names:
                del file[name]

    return damage


def shorter(name):
    def damage(folder):
        with h5py.File(folder / "result.h5", "r+") as file:
            values = file[name][()]
            del file[name]
            file[name] = values[:-1]

    return damage


def document(edit):
    def damage(folder):
        path = folder / "result.json"
        content = json.loads(path.read_text())
        edit(content)
        path.write_text(json.dumps(content))

    return damage


DAMAGES = {
    "no result.json": lambda folder: (folder / "result.json").unlink(),
    "no result.h5": lambda folder: (folder / "result.h5").unlink(),
    "a cut result.json": cut("result.json", 0.5),
    "an empty result.json": cut("result.json", 0.0),
    "a cut result.h5": cut("result.h5", 0.5),
    "an empty result.h5": cut("result.h5", 0.0),
    "another HDF5 file": foreign,
    "no fibres": without("fibre"),
    "no stresses": without("state/1/stress"),
    "fewer stresses": shorter("state/1/stress"),
    "fewer labels": shorter("mesh/phase"),
    "another schema": document(lambda content: content.update(schema=99)),
    "no case": document(lambda content: content.pop("case")),
    "no solver": document(lambda content: content.pop("solver")),
    "a text for the solver": document(lambda content: content.update(solver="none")),
    "no material": document(lambda content: content["case"].update(material={})),
    "a list": lambda folder: (folder / "result.json").write_text("[1, 2]"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_unreadable_results_are_reported_in_one_line(result, tmp_path, name, capsys):
    copy = falsified(result, tmp_path / "copy", lambda *_: None)
    DAMAGES[name](copy)
    with pytest.raises(CaseError) as caught:
        verify(copy)
    (fault,) = caught.value.faults
    assert "\n" not in fault and ("result" in fault or str(copy) in fault) and "Error" not in fault
    assert "crashes" not in fault
    assert main(["verify", str(copy)]) == 2
    errors = capsys.readouterr().err  # sizes are compared before verify reads
    assert errors.startswith("error: ") and errors.count("\n") == 1 and "result" in errors


def test_every_rank_of_a_launcher_has_the_verdict_and_the_first_one_prints(result, tmp_path, capsys, monkeypatch):
    copy = falsified(result, tmp_path / "copy", lambda _, file: file["state/1/traction"].__setitem__(3, [1.0, 2.0]))
    monkeypatch.setenv("SLURM_PROCID", "1")
    assert main(["verify", str(copy)]) == 3 and main(["-feti_ksp_rtol", "1e-8", "verify", str(result)]) == 0
    assert main(["verify", str(tmp_path)]) == 2
    assert capsys.readouterr() == ("", "")
    monkeypatch.setenv("SLURM_PROCID", "0")
    assert main(["verify", str(copy)]) == 3
    assert "laws are broken" in capsys.readouterr().out


def test_the_command_line_tells_every_law_and_ends_with_its_verdict(result, tmp_path, capsys):
    assert main(["verify", str(result)]) == 0
    lines = capsys.readouterr().out.splitlines()
    laws = [finding.name for finding in verify(result).findings]
    assert [line.split("  ")[0] for line in lines[2 : 2 + len(laws)]] == laws
    assert lines[2 + len(laws) : 4 + len(laws)] == ["every law holds", "not checked:"]
    assert main(["verify", str(result), "--json"]) == 0
    certificate = json.loads(capsys.readouterr().out)
    assert certificate["holds"] and [law["law"] for law in certificate["laws"]] == laws
    copy = falsified(result, tmp_path / "copy", lambda _, file: file["state/1/traction"].__setitem__(3, [1.0, 2.0]))
    assert main(["verify", str(copy)]) == 3
    output = capsys.readouterr().out
    files, line = (line for line in output.splitlines() if "BROKEN" in line)
    assert files.startswith("files") and line.startswith("equilibrium")
    assert "state 1 (E22), mesh node" in line and "(interface node 3)" in line
    assert f"\n2 of {len(laws)} laws are broken\nnot checked:\n" in output
