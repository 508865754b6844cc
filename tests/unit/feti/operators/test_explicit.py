"""Boundary operators of a subdomain, inverses with springs and assembled factors, against dense algebra."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from reference.dense_feti import boundary_of, kernel, schur
from scipy.sparse import csr_matrix, identity
from support import torn_cells

from feti_homog.errors import ConvergenceError
from feti_homog.fem.problem import PLANE
from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.operators.one_subdomain import ExplicitInterfaceOperator, ImplicitInterfaceOperator, Interior
from feti_homog.feti.operators.preconditioners import SpringUpdate

TIGHT = 1e-10


@pytest.fixture(
    scope="module",
    params=[{}, {"subdomains": 6}, {"subdomains": 6, "order": 2}, {"bodies": "plane"}],
    ids=["whole", "cut", "quadratic", "plane"],
)
def parts(request):
    """(subdomain, boundary dofs, K, S) of pinned and of free subdomains, with and without a rotation."""
    case = dict(request.param)
    pieces = {"subdomains": case.pop("subdomains")} if "subdomains" in case else {}
    cell = torn_cells.tear(MPI.COMM_SELF, geometry="hexagonal", mesh_size=0.2, decomposition=pieces, **case)
    found = []
    for s, first in zip(cell.subdomains, cell.offsets, strict=False):
        K = s.assemble_stiffness().toarray()
        dofs = boundary_of(cell.solver.jump_operator.B[:, first : first + len(K)].toarray())
        found.append((s, dofs, K, schur(K, dofs)))
    yield found
    cell.solver.destroy()


def applied(function, x):
    out = np.full_like(x, np.nan)
    function(x, out)
    return out


def test_several_kernels_are_met(parts):
    assert len({s.R.shape[1] for s, *_ in parts}) > 1
    for s, _, _, S in parts:
        assert kernel(S).shape[1] == s.R.shape[1]


@pytest.mark.parametrize("kind", [ExplicitInterfaceOperator, ImplicitInterfaceOperator])
def test_apply_schur_is_the_schur_complement(parts, kind):
    for s, dofs, _, S in parts:
        found = applied(kind(s, s.take_stiffness(), dofs).apply_schur, np.eye(len(dofs)))
        assert np.abs(found - S).max() < TIGHT * np.abs(S).max()


def test_the_order_of_elimination_changes_no_displacement(parts):
    for _, dofs, K, _ in parts:
        order = np.random.default_rng(2).permutation(len(K))
        sorted_dofs, ordered = (Interior(csr_matrix(K), dofs, each) for each in (None, order))
        assert np.array_equal(ordered.dofs, order[np.isin(order, sorted_dofs.dofs)])
        x, found = np.random.default_rng(1).standard_normal((len(dofs), 2)), np.zeros((len(K), 2))
        expected = found.copy()
        expected[sorted_dofs.dofs], found[ordered.dofs] = sorted_dofs.extend(x), ordered.extend(x)
        assert np.abs(found - expected).max() < TIGHT * np.abs(x).max()


@pytest.mark.parametrize("kind", [ExplicitInterfaceOperator, ImplicitInterfaceOperator])
def test_flexibility_is_a_generalized_inverse(parts, kind):
    for s, dofs, _, S in parts:
        flexibility = applied(kind(s, s.take_stiffness(), dofs).apply_flexibility, np.eye(len(dofs)))
        assert np.abs(S @ flexibility @ S - S).max() < TIGHT * np.abs(S).max()
        assert np.abs(flexibility - flexibility.T).max() < TIGHT * np.abs(flexibility).max()
        # Definite, so that F is.
        assert np.linalg.eigvalsh(flexibility)[0] > 0


def test_implicit_operators_give_the_numbers_of_explicit_ones(parts):
    for s, dofs, _, _ in parts:
        dense, sparse = (
            kind(s, s.take_stiffness(), dofs) for kind in (ExplicitInterfaceOperator, ImplicitInterfaceOperator)
        )
        x = np.random.default_rng(1).standard_normal((len(dofs), 4))
        for first, second in (
            (dense.apply_schur, sparse.apply_schur),
            (dense.apply_flexibility, sparse.apply_flexibility),
        ):
            expected = applied(first, x)
            assert np.abs(applied(second, x) - expected).max() < TIGHT * np.abs(expected).max()


@pytest.mark.parametrize("kind", [ExplicitInterfaceOperator, ImplicitInterfaceOperator])
def test_one_vector_is_a_column_of_many(parts, kind):
    for s, dofs, _, _ in parts:
        operator = kind(s, s.take_stiffness(), dofs)
        x = np.random.default_rng(2).standard_normal((len(dofs), 3))
        for function in (operator.apply_schur, operator.apply_flexibility):
            before = x.copy()
            together = applied(function, x)
            assert (x == before).all()
            for k in range(3):
                alone = applied(function, x[:, k].copy())
                assert np.abs(alone - together[:, k]).max() < TIGHT * np.abs(together).max()


def test_the_result_is_the_same_with_and_without_an_array_for_it(parts):
    for s, dofs, _, _ in parts:
        operator = ExplicitInterfaceOperator(s, s.take_stiffness(), dofs)
        X = np.random.default_rng(3).standard_normal((len(dofs), 7))
        before, expected = X.copy(), applied(operator.apply_flexibility, X)
        for order in "CF":
            given = np.array(X, order=order)
            assert np.abs(operator.apply_flexibility(given) - expected).max() < TIGHT * np.abs(expected).max()
            assert (given == before).all()


def test_dense_matrices_are_those_that_are_applied(parts):
    for s, dofs, _, S in parts:
        operator = ExplicitInterfaceOperator(s, s.take_stiffness(), dofs)
        assert np.abs(operator.S - S).max() < TIGHT * np.abs(S).max()
        regularised = operator.regularised_schur
        assert np.linalg.eigvalsh(regularised)[0] > 0
        regularisation = operator.regularisation(identity(len(dofs)).tocsr())
        assert np.abs(regularisation - (regularised - operator.S)).max() < TIGHT * np.abs(S).max()
        inverse = applied(operator.apply_flexibility, np.eye(len(dofs)))
        assert np.abs(regularised @ inverse - np.eye(len(dofs))).max() < 1e-8


def test_indefinite_subdomain_is_refused():
    K = csr_matrix(np.diag([1.0, 1.0, -1.0, 1.0]))
    subdomain = SimpleNamespace(
        problem=PLANE, fixing=lambda K, nodes: (np.zeros(0, np.int64), np.zeros((0, 0))), loads_inside=False,
        Q=np.zeros((4, 3)), volume_stiffness=np.eye(3), elimination_order=lambda: None,
    )  # fmt: skip
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        ExplicitInterfaceOperator(subdomain, K, np.arange(4))


@pytest.mark.parametrize("softness", [1e-12, 1.0, 1e6, 1e15, 1e25])
def test_the_inverse_with_springs_is_exact_row_by_row(softness):
    """Also where the springs are so soft that nothing of H is left on their rows."""
    rng = np.random.default_rng(3)
    half, compliance = rng.standard_normal((7, 7)), np.zeros(7)
    H, compliance[[1, 2, 5]] = half @ half.T + np.eye(7), softness * np.array([1.0, 3.0, 0.2])
    update = SpringUpdate(MPI.COMM_SELF, 0, compliance, lambda r: H @ r)
    size = np.sqrt(1.0 + compliance)
    flexibility = (np.linalg.inv(H) + np.diag(compliance)) / np.outer(size, size)
    expected = np.linalg.inv(flexibility) / np.outer(size, size)
    off = np.abs(update.apply(H) - expected).max(axis=1)
    assert (off < 1e-12 * np.abs(expected).max(axis=1)).all()


def test_springs_beside_what_is_not_definite_are_refused():
    with pytest.raises(ConvergenceError, match="springs too soft beside the pieces of cut fibres"):
        SpringUpdate(MPI.COMM_SELF, 0, np.array([1e20, 1.0]), lambda r: np.array([[-1e-12, 0.0], [0.0, 1.0]]) @ r)


CUT = {"geometry": "random", "fibres": 5, "fibre_fraction": 0.3, "min_gap": 0.1, "decomposition": {"subdomains": 24}}


@pytest.mark.parametrize(
    ("case", "options", "kind"),
    [
        ({"geometry": "square"}, {}, DenseSolver),
        ({"geometry": "square"}, {"feti_bonded_pc_factor_mat_solver_type": "mumps"}, DirectSolver),
        (CUT, {}, DirectSolver),
    ],
)
def test_full_sums_without_options_are_factored_as_dense_ones(case, options, kind):
    solver = torn_cells.tear(MPI.COMM_SELF, **case, petsc={"feti_pc_type": "influence"} | options).solver
    assembled, operators = solver.exact_inverse.reference.assembled, solver.interface_operators
    assert type(assembled._solver) is kind
    Z = assembled._Z.toarray()
    forces = np.random.default_rng(0).normal(size=(len(Z), 3))
    expected = -Z @ np.linalg.solve(Z.T @ operators.apply_with_springs(Z), Z.T @ forces)
    np.testing.assert_allclose(assembled.relieving_displacement(forces), expected, atol=1e-9 * np.abs(expected).max())
    # Copies of a node move together.
    assert np.abs(operators.B @ Z).max() < 1e-14
