"""Results of conduction in which one number is false break the laws that they must break."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.falsifications import broken, document, shift
from support.verified_results import falsified

from feti_homog.verify.check_constants import check_conductivity
from feti_homog.verify.findings import Findings, checks

pytestmark = pytest.mark.slow

FALSE = {
    "a conductivity": ("conductivity", document("effective_conductivity", 2, 2), {"tables"}),
    "a coupling of conductivities": (
        "conductance", document("effective_conductivity", 0, 1, factor=1.01), {"tables", "symmetry"},
    ),
    "a conductivity of a phase": (
        "conductivity", document("case", "material", "fibre", "conductivity", "axial"),
        {"stress", "mean stress", "bounds"},
    ),
    "a tensor of a phase": (
        "conductance", document("case", "material", "fibre", "conductivity", 0, 0),
        {"stress", "equilibrium", "mean stress"},
    ),
    "a conductance": ("conductance", document("case", "interface", "conductance", factor=1.01), {"bond"}),
    "a bound of conductivities": (
        "conductivity", document("conductivity_estimates", "hashin_shtrikman", 1), {"bounds"},
    ),
    "Wiener's bound": ("conductivity", document("conductivity_estimates", "wiener", 0), {"bounds"}),
    "a conductivity beyond its bounds": (
        "conductivity", document("effective_conductivity", 0, 0, factor=10.0), {"bounds", "tables"},
    ),
    "a mean of conductivities": ("conductivity", document("conductivity_estimates", "axial"), {"bounds"}),
    "a temperature": (
        "conductivity", shift("axial_displacement"), {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_copy_breaks_its_laws(results, tmp_path, name):
    kind, edit, laws = FALSE[name]
    assert broken(falsified(results(kind), tmp_path / "copy", edit)) == laws | {"files"}


@pytest.mark.parametrize("bonds", [{}, {"conductance": 3.0}], ids=str)
@pytest.mark.parametrize("with_bounds", [True, False])
def test_bounds_of_conductivities_are_those_of_bonds_without_resistance(bonds, with_bounds):
    """Two halves that conduct 1 and 3 across the fibres, 2 and 4 along; k^ef is Hashin and Shtrikman's lower bound."""
    k, A = np.diag([5 / 3, 5 / 3, 3.0]), np.zeros((2, 6, 6))
    A[:, [2, 3, 4], [2, 3, 4]] = [[2.0, 1.0, 1.0], [4.0, 3.0, 3.0]]
    bounds = {"wiener": [1.5, 2.0], "hashin_shtrikman": [5 / 3, 1.8]} if with_bounds else {}
    forms = {"axial": 3.0, "wiener": None, "hashin_shtrikman": None} | bounds
    document = {"effective_conductivity": k, "conductivity_estimates": forms}
    files = SimpleNamespace(document=document, interfaces=[bonds])
    found = Findings(checks(1e-9, False))
    check_conductivity(found, SimpleNamespace(files=files, fractions=np.array([0.5, 0.5]), stiffnesses=A))
    assert [one.name for one in found.worst() if not one.holds] == ["bounds"] * (bool(bonds) is with_bounds)
