"""The further starts of a fit, with a cohesive bar in closed form in place of cells."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.stats import chi2

from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.studies import estimation, fit_file
from feti_homog.studies.fit import Evaluations

STRAINS = np.linspace(0.001, 0.02, 15)
TRUTH = (30.0, 0.2)  # strength, energy per volume


def bar(x: Any) -> Any:
    """Stress of a bar of stiffness 1e4 that softens in a straight line after its strength, and takes the energy."""
    strength, energy = x
    first, last = strength / 1e4, 2 * energy / strength
    return np.interp(STRAINS, [0.0, first, max(last, first * (1 + 1e-9))], [0.0, strength, 0.0], right=0.0)


class OfBars(Evaluations):
    """Evaluations of the bar; `fails` tells where a case cannot be run."""

    count = 0

    def fails(self, x: Any) -> bool:
        return False

    def _run(self, name: str, places: Any) -> list[Any]:
        self.count += len(places)
        if any(self.fails(x) for _, x in places):
            raise ConvergenceError("1 of 1 cases failed")
        return [({"case": {"analysis": {"type": "path"}, "interface": []}, "path": [{}]}, bar(x)) for _, x in places]


def evaluations(folder: Path, monkeypatch: pytest.MonkeyPatch, start: tuple[float, float], std: float = 0.3) -> OfBars:
    rows = "".join(f"{strain}, {stress}\n" for strain, stress in zip(STRAINS, bar(TRUTH), strict=True))
    (folder / "curve.csv").write_text(f"E11, S11\n{rows}")
    document = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4},
        "material": {phase: {"young": 1.0, "poisson": 0.3} for phase in ("matrix", "fibre")},
        "analysis": {"type": "path", "plane": "strain"},
        "interface": {},
        "path": {"strain": [0.03, 0.0, 0.0]},
        "unknown": {
            "interface.normal_strength": {"start": start[0], "lower": 5.0, "upper": 150.0},
            "interface.tangential_strength": {"start": start[1], "lower": 0.05, "upper": 2.0},
        },
        "measured": {"curve": {"file": str(folder / "curve.csv"), "std": std}},
    }
    monkeypatch.setattr("feti_homog.studies.fit.exact_derivatives", lambda *_: None)
    evaluator = SimpleNamespace(comm=MPI.COMM_SELF, quiet=True)
    return OfBars(fit_file.parse(document, folder), evaluator)  # type: ignore[arg-type]


@pytest.mark.parametrize("start", [(140.0, 0.06), (7.0, 1.9), (140.0, 1.9), (6.0, 0.06)])
def test_far_starts_end_at_the_truth(tmp_path, monkeypatch, start):
    found = evaluations(tmp_path, monkeypatch, start).estimate()
    assert found is not None and not found.misfits
    assert found.x == pytest.approx(TRUTH, rel=0.02)


@pytest.mark.parametrize("chance", [0.002, 0.04])
def test_false_minima_with_possible_residuals_are_left(tmp_path, monkeypatch, chance):
    """The standard deviation gives the false minimum this `chance` under a correct model."""
    start = (140.0, 0.06)
    with monkeypatch.context() as without:
        without.setattr("feti_homog.studies.fit.sampled_points", lambda *_: [])
        false = evaluations(tmp_path, monkeypatch, start).estimate()
    assert false is not None and false.x != pytest.approx(TRUTH, rel=0.1)
    std = 0.3 * np.sqrt(false.residuals @ false.residuals / chi2.isf(chance, len(STRAINS) - false.rank))
    found = evaluations(tmp_path, monkeypatch, start, std).estimate()
    assert found is not None and found.chance is not None and found.chance > 0.5 > 10 * chance


@pytest.mark.parametrize("start", [(40.0, 0.25), (20.0, 0.1), (50.0, 0.15)])
def test_a_simplex_passes_a_staircase(tmp_path, monkeypatch, start):
    """Derivatives mislead a search: between the jumps of the curve, the strength acts in the other direction."""
    smooth, step = bar, 2.0

    def staircase(x: Any) -> Any:
        level = step * round(x[0] / step)
        return smooth((level - 0.3 * (x[0] - level), x[1]))

    monkeypatch.setitem(globals(), "bar", staircase)
    found = []
    for descend in (estimation.descend, lambda *_: None):
        monkeypatch.setattr(estimation, "descend", descend)
        found.append(evaluations(tmp_path, monkeypatch, start).estimate())
    assert found[0].x == pytest.approx(TRUTH, rel=1e-3) and not found[0].misfits and found[1].misfits


def test_a_good_start_needs_no_others(tmp_path, monkeypatch):
    bars = evaluations(tmp_path, monkeypatch, (28.0, 0.19))
    found = bars.estimate()
    assert found is not None and found.x == pytest.approx(TRUTH, rel=1e-3) and len(bars.answers) == found.evaluations


def test_cases_that_fail_are_no_starts(tmp_path, monkeypatch):
    bars = evaluations(tmp_path, monkeypatch, (140.0, 0.06))
    bars.fails = lambda x: 60.0 < x[0] < 120.0  # type: ignore[method-assign]
    found = bars.estimate()
    assert found is not None and found.x == pytest.approx(TRUTH, rel=0.02)
    assert len(bars.answers) < len(bars.folders)
    names = [*bars.folders.values()]
    assert names == [f"evaluation-{k:04d}" for k in range(1, len(names) + 1)]


def test_a_fault_without_any_sound_start_is_that_of_the_start(tmp_path, monkeypatch):
    bars = evaluations(tmp_path, monkeypatch, (140.0, 0.06))

    def refuse(name: str, places: Any) -> list[Any]:
        raise CaseError(f"{name} is refused")

    bars._run = refuse  # type: ignore[method-assign]
    with pytest.raises(CaseError, match="evaluation-0001 is refused"):
        bars.estimate()
