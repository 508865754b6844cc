"""Scatter by uncertain numbers: closed forms beside differences of runs, and the scatter between random cells."""

import json
from pathlib import Path

import numpy as np
import pytest

from feti_homog import CaseError
from feti_homog.report.text import study_tables
from feti_homog.studies import uncertainty
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
MATERIAL = {
    "matrix": {"young": {"mean": 3.0, "cv": 0.01}, "poisson": 0.35},
    "fibre": {"young": {"mean": 70.0, "cv": 0.01}, "poisson": 0.2},
}


@pytest.mark.one_rank
@pytest.mark.parametrize("temperature", [None, -20.0])
def test_onsets_do_not_depend_on_the_unit_of_stress(comm, shared_path, temperature):
    """The sum of p df / dp over all stiffnesses, by differences, and the strength, closed, is zero for a strain.

    Stresses of cooling do not scale with the load.
    """
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.4, "order": 1},
        "material": MATERIAL,
        "analysis": {"type": "envelope", "plane": "strain"},
        "envelope": {"plane": ["E11", "E22"], "directions": 4},
        "interface": {
            "normal_stiffness": {"mean": 100.0, "cv": 0.01}, "tangential_stiffness": {"mean": 50.0, "cv": 0.01},
            "normal_strength": {"mean": 0.05, "cv": 0.1}, "contact": False,
        },
    }  # fmt: skip
    if temperature is not None:
        case["analysis"]["plane"], case["envelope"]["temperature"] = "generalized", temperature
        case["material"] = {phase: own | {"expansion": 1e-5} for phase, own in MATERIAL.items()}
        case["material"]["matrix"]["expansion"] = 6e-5
    study = uncertainty.parse(case, Path())
    found = study.run(shared_path / "out", comm, comm.size, False, True)
    is_closed = temperature is None
    of_strength = "derivatives" if is_closed else "differences"
    assert [each["by"] for each in found["parameters"]] == ["differences"] * 4 + [of_strength]
    means = np.array([each["mean"] for each in found["parameters"]])
    for each in found["results"]:
        terms = means * each["derivatives"]
        assert (terms[-1] == pytest.approx(each["value"], rel=1e-3)) == is_closed
        assert abs(terms.sum()) < 1e-3 * each["value"]
        assert each["std_inputs"] == pytest.approx(np.linalg.norm(terms * ([0.01] * 4 + [0.1])))
        # A load is a rational function of stiffnesses: its second difference is of second order in their scatter.
        assert 0.0 < np.abs(each["bends"]).max() < 1e-3 * abs(each["value"]) and each["bends"][-1] < 1e-9
    stamps = {path: path.stat().st_mtime_ns for path in shared_path.glob("out/*/case-*/result.json")}
    assert len(stamps) == (9 if is_closed else 11)
    assert study.run(shared_path / "out", comm, comm.size, False, True) == found
    assert stamps == {path: path.stat().st_mtime_ns for path in stamps}


def test_random_cells_have_the_scatter_of_inputs_and_that_between_them(comm, shared_path):
    """Average the derivatives over the realisations, without differences."""
    case = {
        "cell": {"geometry": "random", "fibres": 2, "fibre_fraction": 0.3, "mesh_size": 0.3, "seed": 1},
        "material": MATERIAL,
        "analysis": {"type": "stiffness", "plane": "strain"},
        "sweep": {"realisations": 2},
        "uncertainty": {"correlation": [["material.matrix.young", "material.fibre.young", 0.5]]},
    }
    found = uncertainty.parse(case, Path()).run(shared_path / "out", comm, comm.size, False, True)
    assert not (shared_path / "out" / "differences").exists() and found["cells"] == 2
    texts = on_root(comm, lambda: [p.read_text() for p in sorted(shared_path.glob("out/means/case-*/result.json"))])
    cells = [json.loads(each)["sensitivities"] for each in texts]
    J = np.mean([each["derivatives"] for each in cells], axis=0)
    young = [cells[0]["parameters"].index(f"material.{phase}.young") for phase in ("matrix", "fibre")]
    changes = J[:, young] * [0.03, 0.7]
    values = np.array([each["constant_values"] for each in cells])
    for k, each in enumerate(found["results"]):
        inputs = np.sqrt((changes[k] ** 2).sum() + changes[k].prod())
        between = abs(values[0, k] - values[1, k]) / np.sqrt(2)
        assert each["std_inputs"] == pytest.approx(inputs) and each["std_cells"] == pytest.approx(between)
        assert each["std"] == pytest.approx(np.hypot(inputs, between)) and sum(each["shares"]) == pytest.approx(1.0)
        errors = np.abs(np.diff([own["derivatives"][k] for own in cells], axis=0))[0, young] / 2
        assert each["derivative_errors"] == pytest.approx(errors, abs=1e-9) and each["mesh_error"] > 0
    text = study_tables.scatter_text(found)
    assert "+- cells" in text and "Standard error" not in text
    found["results"][0]["derivative_errors"] = [0.51 * abs(each) for each in found["results"][0]["derivatives"]]
    assert "half of the slope by material.fibre.young: C11" in study_tables.scatter_text(found)
    ours = uncertainty.parse(case | {"uncertainty": {"material.fibre.poisson": 0.01}}, Path())
    with pytest.raises(CaseError, match="holds another study of scatter"):
        ours.run(shared_path / "out", comm, comm.size, False, True)


@pytest.mark.one_rank
def test_utilisations_scatter_with_stiffnesses_and_strengths(comm, shared_path):
    """Under a strain the utilisation is homogeneous of degree 1 in all stiffnesses and of degree -1 in the strength."""
    matrix = MATERIAL["matrix"] | {"strength": {"principal": {"mean": 0.08, "cv": 0.01}}}
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.4, "order": 1},
        "material": MATERIAL | {"matrix": matrix},
        "analysis": {"type": "load", "plane": "strain"},
        "load": {"to": {"E11": 0.01, "E22": 0.0, "gamma12": 0.0}},
    }
    found = uncertainty.parse(case, Path()).run(shared_path / "out", comm, comm.size, False, True)
    means = {each["name"]: each["mean"] for each in found["parameters"]}
    assert [each["by"] for each in found["parameters"]] == ["differences"] * 3
    results = {each["name"]: each for each in found["results"]}
    used = results["load_matrix_utilisation"]
    terms = dict(zip(means, np.array([*means.values()]) * used["derivatives"], strict=True))
    assert terms.pop("material.matrix.strength.principal") == pytest.approx(-used["value"], rel=1e-3)
    assert sum(terms.values()) == pytest.approx(used["value"], rel=1e-3)
    stress = results["load_matrix_principal"]
    slopes = dict(zip(means, stress["derivatives"], strict=True))
    assert used["value"] == pytest.approx(stress["value"] / 0.08)
    assert slopes["material.matrix.strength.principal"] == 0.0


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({}, "expected KEY = {mean, std} in place of some number"),
        ({"uncertainty": {"cell": {"geometry": 0.1}}}, "[uncertainty] cell.geometry: expected a key of the case"),
        ({"uncertainty": {"cell": {"fibre_fraction": 0.01}}, "sweep": {"cell": {"fibre_fraction": [0.1, 0.2]}}},
         "[sweep]: expected realisations alone"),
        ({"name": {"mean": 1.0, "std": 0.1}}, "name = {mean = 1.0, std = 0.1}: expected no number"),
        ({"uncertainty": {"cell": {"fibre_fraction": 0.4}}},
         "[uncertainty] cell.fibre_fraction = 0.4 +- 0.4: case-0001: [cell] fibre_fraction = 0.0"),
    ],
)  # fmt: skip
def test_faults_have_their_line(changes, line):
    phases = {"matrix": {"young": 3.0, "poisson": 0.3}, "fibre": {"young": 70.0, "poisson": 0.2}}
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.4},
        "material": phases,
        "analysis": {"type": "stiffness", "plane": "strain"},
    }
    with pytest.raises(CaseError) as error:
        uncertainty.parse(case | changes, Path())
    assert error.value.faults[0].startswith(line), error.value.faults


@pytest.mark.one_rank
def test_scatter_of_paths_of_which_some_break_no_bond_is_refused(comm, shared_path):
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.4, "order": 1},
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "path": {"to": {"S11": 1.0}},
        "interface": {"normal_strength": {"mean": 0.8, "cv": 0.1}, "tangential_strength": 100.0},
    }
    onset = uncertainty.parse(case, Path()).run(shared_path / "all", comm, comm.size, False, True)
    found = next(each["value"] for each in onset["results"] if each["name"] == "onset_load_factor")
    case["path"]["to"]["S11"] = 1.02 * found
    with pytest.raises(CaseError, match=r"^\[path\]: bonds break, or the stress falls, in some runs"):
        uncertainty.parse(case, Path()).run(shared_path / "some", comm, comm.size, False, True)


@pytest.mark.one_rank
def test_conductivities_have_no_rows_of_couplings_that_the_mesh_makes(comm, shared_path):
    """The square cell has none, but for its mesh; derivatives of its least conductivity sum to it (Euler)."""
    conducts = {
        "matrix": {"conductivity": {"mean": 0.2, "cv": 0.05}},
        "fibre": {"conductivity": {"mean": 2.0, "cv": 0.1}},
    }
    case = {"cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.2}, "material": conducts}
    study = uncertainty.parse(case | {"analysis": {"type": "conductivity"}}, Path())
    found = study.run(shared_path / "out", comm, None, False, True)["results"]
    assert [row["name"] for row in found] == ["k11", "k22", "k33"]
    assert np.array([0.2, 2.0]) @ found[0]["derivatives"] == pytest.approx(found[0]["value"], rel=1e-6)
