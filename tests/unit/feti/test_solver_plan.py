"""Preconditioners, coarse spaces and kinds of boundary operators are chosen from sizes and options."""

from dataclasses import replace

import pytest

from feti_homog.errors import CaseError
from feti_homog.feti.operators.interface_operators import KINDS, SubdomainSize
from feti_homog.feti.operators.interface_operators import choose as choose_operators
from feti_homog.feti.solver_plan import BONDED, PRECONDITIONERS, ProblemSizes, SolverOptions, SolverPlan, choose
from feti_homog.feti.thresholds import DEFAULTS, Thresholds

PATH = ProblemSizes(applications=6000, bodies_are_cut=True, all_dense=True, all_searchable=True, shared_dofs=5000)
STIFFNESS = replace(PATH, applications=60)
INFLUENCE, ADAPTIVE, NATURAL = (
    SolverPlan("influence", False), SolverPlan("dirichlet", True), SolverPlan("dirichlet", False),
)  # fmt: skip


def read(**given):
    """Return the options of a database with these values."""
    return SolverOptions.read(given.get, given.get)


@pytest.mark.parametrize(
    ("sizes", "plan"),
    [
        (STIFFNESS, ADAPTIVE),
        (replace(STIFFNESS, bodies_are_cut=False), NATURAL),
        (replace(STIFFNESS, all_dense=False), ADAPTIVE),
        (replace(STIFFNESS, all_dense=False, all_searchable=False), NATURAL),
        (replace(STIFFNESS, one_each=True), SolverPlan(BONDED, False)),
        (replace(STIFFNESS, one_each=True, shared_dofs=0), ADAPTIVE),
        (replace(STIFFNESS, one_each=True, all_dense=False), ADAPTIVE),
        (PATH, INFLUENCE),
        (replace(PATH, bodies_are_cut=False), INFLUENCE),
        (replace(PATH, applications=DEFAULTS.influence_applications - 1), ADAPTIVE),
        (replace(PATH, applications=DEFAULTS.influence_applications), INFLUENCE),
        (replace(PATH, all_dense=False), ADAPTIVE),
        (replace(PATH, shared_dofs=DEFAULTS.assembled_schur_dofs + 1), ADAPTIVE),
        (replace(PATH, shared_dofs=DEFAULTS.assembled_schur_dofs), INFLUENCE),
    ],
)
def test_default_plan(sizes, plan):
    assert choose(sizes, SolverOptions()) == plan


def test_other_thresholds():
    assert choose(STIFFNESS, SolverOptions(), Thresholds(influence_applications=60)) == INFLUENCE
    assert choose(PATH, SolverOptions(), Thresholds(assembled_schur_dofs=10)) == ADAPTIVE


@pytest.mark.parametrize(
    ("options", "plan"),
    [
        ({"preconditioner": "none"}, SolverPlan("none", False)),
        ({"preconditioner": "lumped"}, SolverPlan("lumped", False)),
        ({"preconditioner": "dirichlet"}, ADAPTIVE),
        ({"preconditioner": "influence"}, INFLUENCE),
        ({"coarse_space": "natural"}, INFLUENCE),
        ({"coarse_space": "natural", "preconditioner": "dirichlet"}, NATURAL),
        ({"coarse_space": "adaptive"}, ADAPTIVE),
    ],
)
def test_options_have_their_way(options, plan):
    assert choose(PATH, SolverOptions(**options)) == plan


def test_a_whole_body_by_itself_needs_no_influence_columns():
    alone = replace(PATH, bodies_are_cut=False, all_dense=False, shared_dofs=0)
    assert choose(alone, SolverOptions(preconditioner="influence")) == SolverPlan("none", False)


@pytest.mark.parametrize(
    ("sizes", "options", "words"),
    [
        (replace(PATH, all_dense=False), {"preconditioner": "influence"}, "-feti_pc_type influence: needs"),
        (PATH, {"coarse_space": "adaptive", "preconditioner": "lumped"}, "-feti_coarse_space adaptive: needs"),
        (PATH, {"coarse_space": "adaptive", "preconditioner": "influence"}, "-feti_coarse_space adaptive: needs"),
        (replace(PATH, all_searchable=False), {"coarse_space": "adaptive"}, "-feti_coarse_space adaptive: needs"),
    ],
)
def test_options_that_exclude_each_other(sizes, options, words):
    with pytest.raises(CaseError, match=words):
        choose(sizes, SolverOptions(**options))


@pytest.mark.parametrize(
    ("space", "cut", "wanted"),
    [
        ("auto", True, True), ("auto", False, False), ("adaptive", False, True), ("natural", True, False),
    ],
)  # fmt: skip
def test_soft_modes_are_looked_for(space, cut, wanted):
    assert SolverOptions(coarse_space=space).want_soft_modes(cut) == wanted


def test_options_are_read():
    assert read() == SolverOptions()
    found = read(pc_type="lumped", dual_operator="implicit", coarse_space="natural", coarse_threshold=0.1)
    assert found == SolverOptions("lumped", "implicit", "natural", 0.1)
    assert read(pc_type="influence").operator == "explicit"
    assert read(pc_type="influence", dual_operator="auto").operator == "auto"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"pc_type": "ilu"}, f"-feti_pc_type ilu: expected one of {', '.join(PRECONDITIONERS)}"),
        ({"dual_operator": "direct"}, "-feti_dual_operator direct: expected one of auto, implicit, explicit"),
        ({"coarse_space": "deluxe"}, "-feti_coarse_space deluxe: expected one of auto, natural, adaptive"),
    ],
)
def test_unknown_values(given, words):
    with pytest.raises(CaseError) as caught:
        read(**given)
    assert caught.value.faults == (words,)


def test_coatings_are_left_to_influence_columns_whatever_their_size():
    coated = replace(STIFFNESS, has_thin=True, shared_dofs=10 * DEFAULTS.assembled_schur_dofs)
    assert choose(coated, SolverOptions()).preconditioner == "influence"
    assert choose(replace(coated, all_dense=False), SolverOptions()).preconditioner == "dirichlet"
    assert choose(coated, SolverOptions(preconditioner="dirichlet")).preconditioner == "dirichlet"


LIMITS = Thresholds(dense_boundary_dofs=600, whole_boundary_dofs=200)
MANY = 10**6


def choice(boundary_dofs, kind="auto", applications=0, soft_modes=False, is_whole_body=False, can_condense=True):
    size = SubdomainSize(10 * boundary_dofs, boundary_dofs, is_whole_body)
    (explicit,), (facewise,) = choose_operators([size], kind, applications, soft_modes, can_condense, LIMITS)
    return explicit, facewise


@pytest.mark.parametrize("applications", [0, MANY])
@pytest.mark.parametrize("soft_modes", [False, True])
def test_the_user_decides(applications, soft_modes):
    for n in (100, 10_000):
        assert choice(n, "explicit", applications, soft_modes)[0]
        assert not choice(n, "implicit", applications, soft_modes)[0]


def test_dense_matrices_are_made_where_they_pay_and_fit():
    assert not choice(500, applications=0)[0]
    assert choice(500, applications=MANY)[0]
    assert choice(500, soft_modes=True)[0]
    assert choice(100, soft_modes=True, is_whole_body=True) == (True, False)
    assert choice(500, soft_modes=True, is_whole_body=True) == (False, True)
    assert not choice(601, applications=MANY, soft_modes=True)[0]
    assert not choice(500, applications=MANY, soft_modes=True, can_condense=False)[0]
    sizes = [SubdomainSize(5000, n, False) for n in (100, 700, 300)]
    assert choose_operators(sizes, "auto", 0, True, True, LIMITS)[0] == [True, False, True]


@pytest.mark.parametrize("kind", KINDS)
def test_a_subdomain_without_boundary_has_no_dense_matrix(kind):
    assert choice(0, kind, MANY, soft_modes=True) == (False, False)
