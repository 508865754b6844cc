"""The command line in processes of its own: run, check, plot, keys, and their options."""

import json
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.image import imread
from reference.references import BONDED
from support.command_line import assert_verified, case_file, command_line, in_process
from support.jobs import ROOT
from support.sweep_files import BY_BODIES

PICTURES = ("cell.png", "partition.png", "mesh_error.png", "case_E11.png", "case_E22.png", "case_gamma12.png")
FILES = {"result.json", "result.h5", "result.xdmf", "interface.xdmf", *PICTURES}
DOCUMENT = {
    "version", "case", "cell", "solver", "effective_stiffness", "checks", "timings", "memory", "status",
}  # fmt: skip
CELL = {"width", "height", "area", "fibre_fraction", "elements", "nodes"}
SOLVER = {
    "ranks", "subdomains", "dofs", "multipliers", "kernel_dim", "coarse_dim", "iterations", "converged_reason",
}  # fmt: skip
STAGES = ("mesh", "assemble", "factor", "solve", "output")


def numbers(value):
    """All numbers in a document."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from numbers(item)
    elif isinstance(value, int | float):
        yield value


def contents(path):
    """All tables of a result.h5."""
    import h5py

    tables = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: tables.update({name: item[()]} if isinstance(item, h5py.Dataset) else {}))
    return tables


def assert_pictures(folder):
    for name in PICTURES:
        assert imread(folder / name)[..., :3].std() > 0.05, f"{name} is nearly blank"


@pytest.mark.parametrize("ranks", [0, pytest.param(2, marks=pytest.mark.quick)])
def test_run_writes_every_file_at_any_number_of_ranks(tmp_path, ranks):
    out = tmp_path / "new" / "results"
    job = command_line(ranks, "run", case_file(tmp_path, ""), "--out", out)
    assert job.returncode == 0, job.stderr
    assert {path.name for path in out.iterdir()} == FILES
    for words in (*STAGES, "E11: ", "gamma12: ", "Effective stiffness", "Hashin-Shtr.", "Status      done"):
        assert words in job.stdout
    assert_document(json.loads((out / "result.json").read_text()), max(ranks, 1))
    assert_fields(out)
    assert_pictures(out)
    assert_verified(out)


def test_conductivity_writes_its_files(tmp_path):
    case, out = tmp_path / "conductivity.toml", tmp_path / "results"
    case.write_text((ROOT / "drivers/conductivity.toml").read_text().replace("mesh_size = 0.08", "mesh_size = 0.2"))
    job = in_process("run", case, "--out", out)
    assert job.returncode == 0, job.stderr
    pictures = {name for name in FILES if not name.startswith("case_")} | {"case_dT_dx1.png", "case_dT_dx2.png"}
    assert {path.name for path in out.iterdir()} == pictures
    assert all(imread(path)[..., :3].std() > 0.05 for path in out.glob("*.png"))
    for words in ("dT/dx3: ", "Effective conductivity, axes", "across: Maxwell", "Status      done"):
        assert words in job.stdout
    assert_verified(out)
    text = in_process("keys", "conductivity").stdout
    assert all(words in text for words in ('"conductivity": the effective', "[material.PHASE], conductor"))


def assert_document(document, ranks):
    assert document.keys() >= DOCUMENT
    assert document["cell"].keys() >= CELL and document["solver"].keys() >= SOLVER
    assert document["checks"].keys() >= {"strain", "hill", "symmetry"}
    assert document["timings"].keys() >= set(STAGES) - {"output"}
    assert all(map(math.isfinite, numbers(document)))
    assert document["status"] == "done" and document["solver"]["ranks"] == ranks
    assert document["solver"]["subdomains"] == ranks
    assert document["cell"]["area"] == pytest.approx(math.sqrt(3))
    L = np.array(document["effective_stiffness"])
    assert np.abs(L[[0, 0, 2], [0, 1, 2]] / BONDED["hexagonal", "strain"].value - 1).max() < 0.01


def assert_fields(out):
    tables = contents(out / "result.h5")
    nodes, elements = len(tables["mesh/points"]), len(tables["mesh/triangles"])
    document = json.loads((out / "result.json").read_text())
    assert (nodes, elements) == (document["cell"]["nodes"], document["cell"]["elements"])
    assert tables["mesh/triangles"].max() == nodes - 1
    assert set(tables["mesh/body"]) == set(range(3))
    k = len(tables["interface/points"])
    for state in map(str, range(3)):
        assert tables[f"state/{state}/displacement"].shape == (nodes, 2)
        assert tables[f"state/{state}/stress"].shape == (elements, 3)
        assert tables[f"state/{state}/traction"].shape == tables[f"state/{state}/jump"].shape == (k, 2)
        assert tables[f"state/{state}/status"].shape == (k,) and not tables[f"state/{state}/status"].any()
    assert all(np.isfinite(table).all() for table in tables.values())
    text = "".join(ET.parse(out / "result.xdmf").getroot().itertext())
    sources = re.findall(r"result\.h5:/?(\S+)", text)
    assert {name.split("&")[0] for name in sources} and "result.h5" in text


def test_fields_do_not_depend_on_the_ranks(tmp_path):
    """Traction and jump at the same interface nodes, whatever rank owns them; --quiet prints nothing."""
    tractions = []
    case = case_file(
        tmp_path, "[decomposition]\nsubdomains = 3\n[output]\npictures = false\n[petsc]\nfeti_ksp_rtol = 1e-11\n"
    )
    for ranks in (1, 2):
        words = "run", case, "--out", (out := tmp_path / str(ranks)), "--quiet"
        job = in_process(*words) if ranks == 1 else command_line(ranks, *words)
        assert (job.returncode, job.stdout) == (0, "")
        tables = contents(out / "result.h5")
        order = np.lexsort(tables["interface/points"].round(9).T)
        tractions.append(tables["state/0/traction"][order])
    assert np.abs(tractions[0] - tractions[1]).max() < 1e-7 * np.abs(tractions[0]).max()


def test_plot_draws_what_the_run_did_not_and_needs_the_fields_alone(tmp_path):
    out = tmp_path / "results"
    in_process("run", case_file(tmp_path), "--out", out)
    assert not list(out.glob("*.png"))
    for path in out.iterdir():
        if path.name != "result.h5":
            path.unlink()
    job = command_line(2, "plot", out)
    assert job.returncode == 0, job.stderr
    assert job.stdout.split() == [str(out / name) for name in PICTURES]
    assert_pictures(out)


def test_plot_of_an_empty_folder_names_the_missing_file(tmp_path):
    job = in_process("plot", tmp_path)
    assert job.returncode == 2 and job.stdout == ""
    assert (
        job.stderr.startswith(f"error: cannot read {tmp_path}/result.h5: it is missing")
        and "Traceback" not in job.stderr
    )


@pytest.mark.parametrize("command", ["plot", "report", "fields"])
def test_what_is_no_folder_of_a_result_is_named(tmp_path, command):
    path = case_file(tmp_path)
    job = in_process(command, path)
    assert job.returncode == 2
    assert job.stderr.startswith(f"error: {path}: expected the folder of a result, not a file\n")
    (tmp_path / "fit.json").touch()
    assert f"{tmp_path} has a study: see fit.json, fit.png" in in_process(command, tmp_path).stderr
    (tmp_path / "fit.json").rename(tmp_path / "sweep.json")
    job = in_process(command, tmp_path)
    assert job.returncode == 2 and "not that of a sweep; `feti-homog collect" in job.stderr


def test_without_fields_only_the_json_is_written_and_nothing_drawn(tmp_path):
    out = tmp_path / "results"
    in_process("run", case_file(tmp_path, "[output]\nfields = false\n"), "--out", out)
    job = in_process("plot", out)
    assert job.returncode == 0, job.stderr
    assert {path.name for path in out.iterdir()} == {"result.json"}
    assert job.stdout == f"{out}: nothing to draw: its case has no fields, and no points that make a curve\n"


def test_check_tells_the_plan_and_writes_nothing(tmp_path):
    path = case_file(tmp_path)
    job = command_line(2, "check", path)
    assert job.returncode == 0 and list(tmp_path.iterdir()) == [path]
    assert job.stdout.count("the case is valid") == 1 and "3 bodies" in job.stdout
    assert len(re.findall(r"^rank \d", job.stdout, re.MULTILINE)) == 2


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["--version"], []])
def test_help_lists_options_and_ends_with_0(words):
    job = command_line(2, *words) if words == ["--help"] else in_process(*words)
    assert job.returncode == 0 and not job.stderr
    assert job.stdout.count("feti-homog") >= 1 and job.stdout.count("usage:") <= 1
    if words != ["--version"] and "run" not in words:
        assert "-feti_ksp_rtol <real>" in job.stdout


def test_help_with_one_dash_is_petscs(tmp_path):
    job = command_line(1, "run", case_file(tmp_path), "--out", tmp_path / "results", "-help")
    assert job.returncode == 0
    assert "-feti_ksp_max_it" in job.stdout and "-feti_schur_pc_type" in job.stdout


def test_petscs_monitor_and_log_are_printed(tmp_path):
    words = ["-feti_ksp_monitor", "-feti_ksp_converged_reason", "-log_view"]
    path = case_file(tmp_path, f"[output]\npictures = false\n{BY_BODIES}")
    job = command_line(2, "run", path, "--out", tmp_path / "results", *words)
    assert job.returncode == 0
    assert job.stdout.count("0 KSP Residual norm") >= 1
    assert job.stdout.count("Linear feti_ solve converged due to CONVERGED_RTOL") == 1
    stages = re.findall(r"^ *\d+: +([\w ]+): +\S+ +[\d.]+%", job.stdout, re.MULTILINE)
    assert set(STAGES) <= set(stages)
    for event in ("FETISubdomains", "FETINatural", "FETIDual", "FETIPrecond"):
        assert re.search(rf"^{event} +[1-9]", job.stdout, re.MULTILINE)


def test_command_line_overrides_the_case(tmp_path):
    path = case_file(tmp_path, "[petsc]\nfeti_ksp_rtol = 1e-10\nfeti_pc_type = 'lumped'\n[output]\npictures = false\n")
    documents = []
    for number, words in enumerate([[], ["-feti_ksp_rtol", "1e-4"]]):
        out = tmp_path / str(number)
        assert command_line(0, "run", path, "--out", out, *words).returncode == 0
        documents.append(json.loads((out / "result.json").read_text())["solver"])
    assert [document["rtol"] for document in documents] == [1e-10, 1e-4]
    assert max(documents[1]["iterations"]) < min(documents[0]["iterations"])


def test_a_nearly_incompressible_phase_makes_elements_quadratic(tmp_path):
    path = case_file(tmp_path)
    path.write_text(path.read_text().replace("0.299", "0.4999999"))
    job = command_line(2, "run", path, "--out", tmp_path / "results", "-feti_ksp_rtol", "1e-6")
    printed = " ".join(job.stdout.split())
    lines = ["Remark [material.matrix] poisson = 0.4999999: elements are"]
    # A warning comes while there is time to stop the run, and with the result.
    lines += [f"{label} -feti_ksp_rtol 1e-06 asks for less" for label in ("warning:", "Warning")]
    assert job.returncode == 0 and [printed.count(line) for line in lines] == [1, 1, 1]


def test_keys_of_all_sections():
    job = command_line(2, "keys")
    assert job.returncode == 0, job.stderr
    assert (
        job.stdout.startswith("Keys by need. ")
        and job.stdout.count("[cell]: Geometry") == 1
        and "  realisations\n" in job.stdout
    )


def test_keys_of_a_section():
    job = in_process("keys", "interface")
    assert job.returncode == 0 and job.stdout.startswith("[interface]: ")
    assert "an arc of [interface] debonded: " in job.stdout and "[cell]: " not in job.stdout


def test_keys_of_a_word_that_is_nowhere():
    job = command_line(2, "keys", "qwxz")
    assert job.returncode == 2 and job.stderr.count("error: keys qwxz: no key, section or description has it; ") == 1


@pytest.mark.parametrize("name", ["schema", "statistics"])
def test_commands_that_are_gone_name_the_way(name):
    job = in_process(name)
    assert (job.returncode, job.stdout) == (2, "") and job.stderr.startswith(
        f"error: command line: feti-homog {name} is "
    )
