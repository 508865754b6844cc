"""Every law of the certificate has a result that breaks it: no check always holds, and none is never called."""

import json

import numpy as np
import pytest
from support.falsifications import attribute, both, broken, document, raised, shift
from support.verified_results import falsified
from unit.verify import test_falsified_loads, test_falsified_results

from feti_homog.verify.certificate import verify
from feti_homog.verify.findings import checks

pytestmark = pytest.mark.slow

TABLES = test_falsified_results.FALSE, test_falsified_loads.FALSE, test_falsified_loads.ENVELOPES


def with_nodes(order):
    """Return an edit of one element whose nodes are others of its own."""

    def edit(_, file):
        file["mesh/triangles"][5] = file["mesh/triangles"][5][order]

    return edit


def one_state(_, file):
    for number in list(file["state"])[1:]:
        del file[f"state/{number}"]


def moved_subdomain(_, file):
    """Move a part of the matrix, which is glued to others."""
    subdomain, phase = file["mesh/subdomain"][()], file["mesh/phase"][()]
    own = np.unique(file["mesh/triangles"][()][subdomain == subdomain[phase == 0][0]])
    values = file["state/0/displacement"][()]
    values[own] += 1e-3
    file["state/0/displacement"][()] = values


def pulled_face(_, file):
    state = next(state for state in file["state"].values() if (state["status"][()] == 1).any())
    tractions = state["traction"][()]
    tractions[state["status"][()] == 1, 0] *= -1.0
    state["traction"][()] = tractions


def other_way(_, file):
    """Faces slide with their friction."""
    slid = next(state for state in file["state"].values() if state["sliding"][()].any())
    slid["sliding"][()] = -slid["sliding"][()]


def scaled_derivatives(content, _):
    data = content["sensitivities"]
    data["derivatives"] = (1.01 * np.array(data["derivatives"])).tolist()


def scaled_constants(content, _):
    data = content["sensitivities"]
    data["constant_values"] = (1.01 * np.array(data["constant_values"])).tolist()


# Of laws beside those of the tables: a kind of result, and edits each of which breaks the law.
BREAK = {
    "files": ("bonded", [lambda content, _: content.update(version="2.0.0")]),
    "status": (
        "bonded",
        [
            document("status", to="not converged"),
            both(document("status", to="not converged"), document("faults", to=["E11: check hill: 1.0e-04, expected"])),
            document("checks", "hill", to=1e-4),
            document("check_tolerance", factor=10.0),
            document("kkt_tolerance", factor=10.0),
            document("solver", "rtol", factor=10.0),
            document("solver", "converged_reason", to=[2, -3, 2]),
        ],
    ),
    "cell": (
        "plane",
        [
            document("case", "cell", "order", to=2),
        ],
    ),
    "mesh error": (
        "bonded",
        [
            document("mesh_error", "effective_stiffness", 0, 0, factor=1e-3),
        ],
    ),
    "mesh": ("bonded", [with_nodes([0, 2, 1, 5, 4, 3]), with_nodes([0] * 6)]),
    "load": ("angle", [one_state]),
    "stress": ("bonded", [shift("points", group="mesh")]),
    "equilibrium": ("bonded", [shift("points", group="mesh")]),
    "continuity": ("bonded", [moved_subdomain]),
    "mean strain": ("bonded", [attribute("strain", factor=1.01)]),
    "symmetry": ("bonded", [document("effective_stiffness", 0, 1, factor=1.01)]),
    "tension": ("contact", [pulled_face]),
    "rates": (
        "contact",
        [
            *(document("tips", name, 0, factor=1.01) for name in ("G", "G_I", "G_II", "psi", "angle", "length")),
            document("tips", "fibre", 0, to=2),
            document("tips", "load", 0, to="E33"),
        ],
    ),
    "sliding": ("friction", [other_way]),
    # Energies stay balanced: heat that falls, heat of slips that there are none of, loss without breaks.
    "heat": ("friction", [
        document("path", 5, "work", factor=1.01), raised(5, -1e-3, "friction_heat", "work"),
        raised(5, 1e-3, "dissipated", "dissipated_strain_controlled", "work"),
    ]),
    "sensitivities": ("derivatives", [scaled_derivatives]),
    "constants": ("derivatives under contact", [scaled_constants]),
}  # fmt: skip


@pytest.mark.parametrize("law", BREAK)
def test_false_results_break_the_law(results, tmp_path, law):
    kind, edits = BREAK[law]
    for number, edit in enumerate(edits):
        assert law in broken(falsified(results(kind), tmp_path / str(number), edit)), number


def test_the_heat_of_an_increment_is_that_of_its_slips_in_a_whole_result(results, tmp_path):
    """The balance of work holds, and heat grows: only the slips in the fields tell."""
    path = json.loads((results("friction by steps") / "result.json").read_text())["path"]
    step = next(k for k, point in enumerate(path) if k and not point["broke"])
    edit = raised(step, 1e-4, "friction_heat", "work")
    assert broken(falsified(results("friction by steps"), tmp_path / "copy", edit)) == {"files", "heat"}


def test_every_law_is_broken_by_some_example():
    """The law of given displacements on sides by a user's mesh: `test_falsified_sides`."""
    known = {*BREAK, "sides"}.union(*(laws for table in TABLES for _, _, laws in table.values()))
    assert {check.name for check in checks(1e-8, users_mesh=False)} <= known


def test_sizes_of_energy_release_rates_are_listed_as_unchecked(results, tmp_path):
    """Their sums and modes are checked: a common factor breaks no law."""
    names = ("G", "G_I", "G_II")
    edit = both(*(document("tips", name, 0, factor=1.1) for name in names))
    certificate = verify(falsified(results("contact"), tmp_path / "out", edit))
    listed = {name for table in certificate.unchecked.values() for name in table}
    assert {finding.name for finding in certificate.findings if not finding.holds} == {"files"}
    assert {f"tips.{name}" for name in names} <= listed
