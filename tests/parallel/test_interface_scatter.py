"""Strengths that differ from fibre to fibre: against cells whose fibres have interfaces of their own."""

import numpy as np
import pytest
from scipy.stats import weibull_min
from support import cases
from support.ranks import PIECES, assert_certified

from feti_homog import Case, run
from feti_homog.homogenization.phase_laws import strength_factors

EPOXY, GLASS = {"young": 2.79, "poisson": 0.33}, {"young": 70.8, "poisson": 0.22}
CENTRES = [(1.0, 1.1), (3.0, 0.9), (1.9, 2.9)]
COLUMN = [1.2, 0.7, 1.1]
SPRINGS = {"normal_stiffness": 2.0, "tangential_stiffness": 0.5}
STRENGTH = {"criterion": "quadratic", "normal_strength": 0.06, "tangential_strength": 0.08}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 4e-4}
BILINEAR = {"law": "bilinear", "normal_stiffness": 20.0, "tangential_stiffness": 12.0, "teeth": 2}
BILINEAR |= {
    "normal_strength": 0.06,
    "tangential_strength": 0.08,
    "normal_toughness": 4e-4,
    "tangential_toughness": 8e-4,
}
LAWS = {"strength": STRENGTH, "released": ENERGY, "springs": ENERGY | {"growth": "springs"}, "bilinear": BILINEAR}
POWERS = {name: 1 for name in ("normal_strength", "tangential_strength")}
POWERS |= {name: 2 for name in ("toughness", "normal_toughness", "tangential_toughness")}
PATH = {"to": {"E11": 0.1, "E22": 0.0, "gamma12": 0.02}}
ENVELOPE = {"plane": ["S11", "S12"], "directions": 8}


def case_of(interface, rows, mesh_size=0.25, **analysis):
    """Return a case of three fibres; `rows` is what their table has beside circles."""
    fibres = [{"x": x, "y": y, "radius": 0.7} | row for (x, y), row in zip(CENTRES, rows, strict=True)]
    cell = {"geometry": "table", "width": 4.0, "height": 4.0, "mesh_size": mesh_size, "fibre_list": fibres}
    materials = {"matrix": EPOXY} | {fibre.get("phase", "fibre"): GLASS for fibre in fibres}
    return cases.case_of(cell, material=materials, interface=interface, decomposition=PIECES, **analysis)


def weibull(shape, seed, n=3):
    """Return quantiles of SciPy's distribution with mean 1."""
    stream, law = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,))), weibull_min(shape)
    return law.ppf(stream.random(n)) / law.mean()


@pytest.mark.one_rank
@pytest.mark.parallel
@pytest.mark.parametrize(
    "law, column, analysis",
    [
        ("strength", False, {"path": PATH}),
        ("released", True, {"path": PATH}),
        ("springs", False, {"path": PATH}),
        ("bilinear", True, {"path": PATH}),
        ("strength", True, {"envelope": ENVELOPE}),
    ],
)
def test_fibres_break_as_with_interfaces_of_their_own(comm, shared_path, law, column, analysis):
    """Fibres of three phases of one material, each with its section of multiplied strengths, and verified files."""
    factors = weibull(4.0, 7) * (COLUMN if column else 1.0)
    phases = ["fibre", "fibre:2", "fibre:3"]
    sections = [
        {key: value * f ** POWERS.get(key, 0) if key in POWERS else value for key, value in LAWS[law].items()}
        | {"between": ["matrix", phase]}
        for f, phase in zip(factors, phases, strict=True)
    ]
    expected = run(case_of(sections, [{"phase": phase} for phase in phases], **analysis), comm)
    rows = [{"strength": f} if column else {} for f in COLUMN]
    case = case_of(LAWS[law] | {"scatter": {"shape": 4.0, "seed": 7}}, rows, **analysis)
    found = run(case, comm, out=shared_path / "out")
    assert [fibre.strength for fibre in found.fibres] == pytest.approx(factors, rel=1e-13)
    if found.path:
        assert [point.broke for point in found.path] == [point.broke for point in expected.path]
        stress = np.array([point.stress for point in expected.path])
        assert len(stress) > 8
        assert np.array([p.stress for p in found.path]) == pytest.approx(stress, abs=1e-8 * np.abs(stress).max())
    else:
        assert [(p.fibre, p.factor) for p in found.envelope] == [
            (p.fibre, pytest.approx(p.factor, rel=1e-9)) for p in expected.envelope
        ]
    assert_certified(comm, shared_path / "out")


@pytest.mark.one_rank
def test_factors_are_of_the_fibre_alone():
    """Factors have mean 1 and the right coefficient of variation; other fibres or seeds do not matter."""
    case = case_of(STRENGTH | {"scatter": {"shape": 8.0, "seed": 3}}, [{}] * 3, path=PATH)
    other = case_of(STRENGTH | {"scatter": {"shape": 8.0, "seed": 4}}, [{}] * 3, path=PATH)
    finer = case_of(STRENGTH | {"scatter": {"shape": 8.0, "seed": 3}}, [{}] * 3, mesh_size=0.04, path=PATH)
    assert (strength_factors(case, 3) == strength_factors(finer, 3)).all()
    assert not np.isin(strength_factors(case, 3), strength_factors(other, 3)).any()
    random = Case.parse(case.resolved() | {"cell": {"geometry": "random", "fibres": 20000, "fibre_fraction": 0.1}})
    many = strength_factors(random, 20000)
    assert (many[:3] == strength_factors(case, 3)).all()
    assert many.mean() == pytest.approx(1.0, abs=0.005) and many.std() == pytest.approx(0.148, abs=0.003)
