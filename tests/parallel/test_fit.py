"""Fits of cells: they return the constants from which data were made, resume, and are the same on any ranks."""

import copy
from pathlib import Path

import numpy as np
import pytest
from support.fitted_composites import case, fit, model, truth

from feti_homog import CaseError, ConvergenceError, run, run_fit, run_sweep
from feti_homog.errors import FolderError
from feti_homog.studies import case_runs, fit_file
from feti_homog.studies.predictions import exact_derivatives, predicted
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


@pytest.fixture(scope="module")
def glass():
    """Provide the document of a fit of glass/epoxy to values without noise."""
    from mpi4py import MPI

    name = "glass/epoxy"
    return fit(name, model(name, MPI.COMM_WORLD)([*truth(name).values()])[0])


@pytest.mark.one_rank
@pytest.mark.parametrize("name", ["boron/aluminium, square", "AS4/3501-6"])
def test_data_without_noise_return_the_truth(comm, shared_path, name):
    """Eight evaluations suffice; intervals and shares agree with the normal equations."""
    values, derivatives = model(name, comm)([*truth(name).values()])
    found = run_fit(fit(name, values), shared_path / "out", comm)
    estimates = {key: own["estimate"] for key, own in found["unknowns"].items()}
    assert estimates == pytest.approx(truth(name), rel=1e-6)
    assert found["evaluations"] <= 8 and found["status"] == "done" and found["sum_of_squares"] < 1e-8
    J = derivatives / (0.01 * np.abs(values))[:, None]
    covariance = np.linalg.inv(J.T @ J)
    shares = ((covariance @ J.T) ** 2).T / np.diag(covariance)
    for k, own in enumerate(found["unknowns"].values()):
        half = 1.959964 * covariance[k, k] ** 0.5
        assert own["interval"] == pytest.approx([own["estimate"] - half, own["estimate"] + half], rel=1e-3)
        assert own["shares"] == pytest.approx(shares[:, k], abs=1e-3)


@pytest.mark.one_rank
def test_warnings_of_the_first_cases_are_printed_once_and_kept(comm, shared_path, glass, capsys):
    document = glass | {"petsc": {"feti_ksp_rtol": 2e-7}}
    kept = run_fit(document, shared_path / "out", comm, quiet=False)["warnings"]
    printed = capsys.readouterr().out.splitlines()
    assert len(kept) == 1 and kept[0].startswith("-feti_ksp_rtol 2e-07 asks for less than the checks do")
    assert printed.count(f"warning: {kept[0]}") == (comm.rank == 0)
    sweep = {name: document[name] for name in ("cell", "analysis", "petsc")} | {"output": {"fields": False}}
    sweep["material"] = {phase: {"young": 3.0, "poisson": 0.3} for phase in ("matrix", "fibre")}
    run_sweep(sweep | {"sweep": {"cell": {"refine": [0, 1]}}}, shared_path / "sweep", comm, quiet=False)
    printed = capsys.readouterr().out.splitlines()
    assert printed.count(f"warning: case-0001: {kept[0]} (2 cases)") == (
        comm.rank == 0
    ) and "warning: case-0002" not in str(printed)


def test_an_interrupted_fit_goes_on_with_what_it_has(comm, shared_path, glass, monkeypatch):
    """Only evaluations that were not finished are computed again; one with a damaged list is no failed evaluation."""
    out, calls, compute = shared_path / "out", [], case_runs.run_all

    def counted(sweep, folder, *arguments, **named):
        calls.append(folder.name)
        if len(calls) == 3:
            raise ConvergenceError("the power is gone")
        compute(sweep, folder, *arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(case_runs, "run_all", counted)
        with pytest.raises(ConvergenceError, match="the power is gone"):
            run_fit(glass, out, comm)
    before = stamps(out)
    assert calls == ["evaluation-0001", "evaluation-0002", "evaluation-0003"] and len(before) == 2
    whole, index = run_fit(glass, shared_path / "whole", comm), out / "evaluation-0002/sweep.json"
    on_root(comm, index.write_text, index.read_text()[:99])
    with pytest.raises(FolderError, match=r"evaluation-0002/sweep.json is damaged: .*remove it"):
        run_fit(glass, out, comm)
    on_root(comm, index.unlink)
    found = run_fit(glass, out, comm)
    assert before.items() <= stamps(out).items() and len(stamps(out)) == found["evaluations"]
    assert found["unknowns"].keys() == whole["unknowns"].keys()
    for key, own in found["unknowns"].items():
        assert own["estimate"] == pytest.approx(whole["unknowns"][key]["estimate"], rel=1e-9)
    other = copy.deepcopy(glass)
    other["measured"]["E1"]["value"] *= 1.01
    with pytest.raises(CaseError, match="holds another fit"):
        run_fit(other, out, comm)


def test_a_fit_of_a_plys_axes_that_fails_says_which_axes_are_the_cells(comm, shared_path, glass, capfd):
    """The modulus along the fibres in place of that across them."""
    document = copy.deepcopy(glass)
    document["unknown"] = {"material.fibre.young": {"start": 60.0, "lower": 50.0, "upper": 80.0}}
    document["material"] = {"fibre": {"poisson": 0.22}, "matrix": {"young": 3.45, "poisson": 0.35}}
    document["measured"] = {"E1": {"value": 1.0, "std": 100.0}}
    with pytest.raises(ConvergenceError, match="hardly determine"):
        run_fit(document, shared_path / "out", comm, quiet=False)
    comm.barrier()
    printed = capfd.readouterr().out
    line = "remark: [measured] E1 is Young's modulus across the fibres; along them E_axial"
    assert comm.rank or printed.splitlines().count(line) == 1


def stamps(out: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in out.glob("evaluation-*/case-*/result.json")}


@pytest.mark.one_rank
def test_tests_share_unknowns_and_fractions_are_fitted(comm, shared_path, glass):
    """Two patterns at an unknown fraction, on groups of ranks, without differences."""
    document = copy.deepcopy(glass)
    for key in truth("glass/epoxy").keys() - {"material.fibre.young"}:
        del document["unknown"][key]
    document["material"]["fibre"] |= {"poisson": 0.22, "expansion": 5.0}
    document["material"]["matrix"] |= {"young": 3.45, "poisson": 0.35, "expansion": 54.0}
    del document["measured"]
    document["unknown"]["cell.fibre_fraction"] = {"start": 0.5, "lower": 0.3, "upper": 0.6}
    document["cell"] = {"mesh_size": 0.3, "order": 2}
    true = {"material.fibre.young": 73.0, "cell.fibre_fraction": 0.53}
    tests = [{"cell": {"geometry": geometry}} for geometry in ("square", "hexagonal")]
    anything = {name: {"value": 1.0, "std": 0.1} for name in ("E3", "E1", "G13")}
    document["test"] = [test | {"measured": anything} for test in tests]
    asked = fit_file.parse(document, Path())
    sweep = asked.at([true[name] for name in asked.unknowns])
    for test, ply in zip(document["test"], sweep.cases, strict=True):
        found = run(ply, comm).sensitivities
        values = dict(zip(found.constants, found.constant_values, strict=True))
        test["measured"] = {n: {"value": float(values[n]), "std": float(0.01 * values[n])} for n in anything}
    found = run_fit(document, shared_path / "out", comm, ranks_per_case=1)
    assert {key: own["estimate"] for key, own in found["unknowns"].items()} == pytest.approx(true, rel=1e-3)
    assert not [*(shared_path / "out").glob("differences-*")]


def test_unknowns_that_the_data_do_not_determine_are_named(comm, shared_path, glass):
    document = copy.deepcopy(glass)
    document["measured"] = {k: v for k, v in glass["measured"].items() if "expansion" not in k}
    with pytest.raises(ConvergenceError) as error:
        run_fit(document, shared_path / "out", comm)
    assert [line for line in error.value.faults if "no measured value depends" in line] == [
        "[unknown] material.fibre.expansion: no measured value depends on it",
        "[unknown] material.matrix.expansion: no measured value depends on it",
    ]
    assert (shared_path / "out" / "fit.json").exists()


STRAINS = (0.008, 0.02, 0.049)
FIBRE_THAT_DEBONDS = {
    "cell": {"geometry": "square", "fibre_fraction": 0.4, "fibre_radius": 7.5, "mesh_size": 0.15},
    "material": {"fibre": {"young": 70800.0, "poisson": 0.22}, "matrix": {"young": 2790.0, "poisson": 0.33}},
    "analysis": {"type": "path", "plane": "strain"},
    "interface": {
        "criterion": "energy", "normal_stiffness": 2025.0, "tangential_stiffness": 506.25, "mode_sensitivity": 0.25,
    },
    "path": {"strain": [0.05, 0.0, 0.0]},
}  # fmt: skip


@pytest.mark.one_rank
def test_toughness_is_fitted_to_onsets_without_differences_and_to_curves_within_their_jumps(comm, shared_path):
    """The derivative of an onset by the scaling law is a central difference; between jumps, a curve has none."""
    document = copy.deepcopy(FIBRE_THAT_DEBONDS)
    document["unknown"] = {"interface.toughness": {"start": 3.0, "lower": 0.5, "upper": 10.0}}
    rows = "".join(f"{strain}, 1.0\n" for strain in STRAINS)
    on_root(comm, (shared_path / "curve.csv").write_text, f"E11, S11\n{rows}")
    document["measured"] = {
        "onset_S11": {"value": 1.0, "std": 0.1},
        "curve": {"file": str(shared_path / "curve.csv"), "std": 0.5},
    }
    asked = on_root(comm, fit_file.parse, document, Path())
    below, found, above = (run(asked.at([G]).cases[0], comm).document for G in (1.9999, 2.0, 2.0001))
    difference = (predicted(above, asked.data) - predicted(below, asked.data)) / 2e-4
    exact = exact_derivatives(found, asked.data[:1], "interface.toughness")
    assert exact == pytest.approx(difference[:1], rel=1e-4, abs=1e-4) and np.abs(difference[1:]).max() < 1e-6
    assert exact_derivatives(found, asked.data, "interface.toughness") is None
    onset, *stresses = predicted(found, asked.data)
    document["measured"]["onset_S11"]["value"] = onset
    rows = "".join(f"{strain}, {stress!r}\n" for strain, stress in zip(STRAINS, map(float, stresses), strict=True))
    on_root(comm, (shared_path / "curve.csv").write_text, f"E11, S11\n{rows}")
    curve = document["measured"].pop("curve")
    fitted = run_fit(document, shared_path / "onset", comm)
    assert fitted["unknowns"]["interface.toughness"]["estimate"] == pytest.approx(2.0, rel=1e-6)
    assert fitted["status"] == "done" and not [*(shared_path / "onset").glob("differences-*")]
    document["measured"] = {"curve": curve}
    fitted = run_fit(document, shared_path / "out", comm)
    low, high = fitted["unknowns"]["interface.toughness"]["interval"]
    assert fitted["status"] == "done" and fitted["sum_of_squares"] < 1e-6 and low < 2.0 < high
    for end, is_met in ((1.5 * low - 0.5 * high, False), (2.0, True), (1.5 * high - 0.5 * low, False)):
        values = predicted(run(asked.at([end]).cases[0], comm).document, asked.data)[1:]
        assert (np.square((values - stresses) / curve["std"]).sum() < 1.96**2) == is_met


def bad_start(comm, path, document, truth, starts):
    """Fit values of a case with the true constants from starts far off; return the fit."""
    document = copy.deepcopy(document)
    bounds = {key: {"lower": low, "upper": high} for key, (_, low, high) in truth.items()}
    document["unknown"] = {key: {"start": value} | bounds[key] for key, (value, *_) in truth.items()}
    asked = on_root(comm, fit_file.parse, document, Path())
    values = predicted(run(asked.at([value for value, *_ in truth.values()]).cases[0], comm).document, asked.data)
    for name, value in zip([name for name in document["measured"] if name != "curve"], values, strict=False):
        document["measured"][name] = {"value": float(value), "std": float(0.01 * abs(value))}
    if "curve" in document["measured"]:
        rows = zip((datum.strain for datum in asked.data), map(float, values), strict=True)
        text = "E11, S11\n" + "".join(f"{strain!r}, {stress!r}\n" for strain, stress in rows)
        on_root(comm, Path(document["measured"]["curve"]["file"]).write_text, text)
    document["unknown"] = {key: {"start": value} | bounds[key] for key, value in zip(truth, starts, strict=True)}
    return run_fit(document, path / "out", comm)


def test_stiffnesses_of_a_phase_are_fitted_from_a_corner_of_their_bounds(comm, shared_path):
    document = case("AS4/3501-6")
    truth = {"E_transverse": (14.0, 1.0, 300.0), "nu_transverse": (0.25, -0.3, 0.6), "G_axial": (28.0, 1.0, 300.0)}
    for name in truth:
        del document["material"]["fibre"][name]
    document["measured"] = {name: {"value": 1.0, "std": 1.0} for name in ("E1", "G23", "G12", "nu12")}
    named = {f"material.fibre.{name}": numbers for name, numbers in truth.items()}
    fitted = bad_start(comm, shared_path, document, named, (7.0, -0.28, 294.0))
    found = fitted["unknowns"]
    assert fitted["evaluations"] < 20 and [own["estimate"] for own in found.values()] == pytest.approx(
        [14.0, 0.25, 28.0], rel=1e-5
    )


def test_stiffnesses_of_an_interface_are_fitted_from_a_corner_of_their_bounds(comm, shared_path):
    document = {name: FIBRE_THAT_DEBONDS[name] for name in ("cell", "material")}
    document |= {"analysis": {"type": "stiffness", "plane": "generalized"}, "interface": {"contact": False}}
    document["measured"] = {name: {"value": 1.0, "std": 1.0} for name in ("E1", "G12", "G13")}
    truth = {"normal_stiffness": (2000.0, 1.0, 1e6), "tangential_stiffness": (500.0, 1.0, 1e6)}
    named = {f"interface.{name}": numbers for name, numbers in truth.items()}
    found = bad_start(comm, shared_path, document, named, (9.8e5, 9.8e5))["unknowns"]
    assert [own["estimate"] for own in found.values()] == pytest.approx([2000.0, 500.0], rel=1e-5)


def test_a_strength_is_fitted_from_a_start_at_which_nothing_breaks(comm, shared_path):
    """The first evaluation has no onset; the best of the further ones leads to the truth."""
    document = copy.deepcopy(FIBRE_THAT_DEBONDS)
    document["interface"] = {"tangential_strength": 1000.0}
    document["path"] = {"strain": [0.01, 0.0, 0.0]}
    document["measured"] = {name: {"value": 1.0, "std": 1.0} for name in ("onset_S11", "peak_S11")}
    truth = {"interface.normal_strength": (30.0, 5.0, 1000.0)}
    found = bad_start(comm, shared_path, document, truth, (900.0,))
    assert found["unknowns"]["interface.normal_strength"]["estimate"] == pytest.approx(30.0, rel=1e-6)
    assert found["status"] == "done" and found["evaluations"] < 20
