"""Fields of generalized plane strain at any number of ranks: averages and third components."""

from typing import Any

import numpy as np
import pytest
from support.ranks import parallel_assert
from support.verified_results import document

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


@pytest.mark.parametrize("kind", ["spatial contact", "spatial springs"])
def test_states_have_all_six_components(comm: Any, kind: str) -> None:
    result = run(Case.parse(document(kind)), comm, fields=True)
    whole = result.fields.gathered()
    parallel_assert(comm, whole is None or _fits(whole))


def _fits(whole: Any) -> bool:
    mesh, states = whole.mesh, whole.states
    for state in states:
        means = np.column_stack([state.stress, state.stress_33, state.axial_stress])[:, [0, 1, 3, 4, 5, 2]]
        areas = _areas(mesh)
        if mesh.triangles.shape[1] == 3:  # of curved elements the areas are others
            expected = areas @ means / areas.sum()
            np.testing.assert_allclose(expected, state.stress_mean, atol=1e-10 * np.abs(state.stress_mean).max())
        np.testing.assert_array_equal(state.traction_vector[:, 2], state.axial_traction)
        np.testing.assert_array_equal(state.jump_vector[:, 2], state.axial_jump)
        fibre = state.axial_displacement[whole.interface.fibre_node]
        np.testing.assert_array_equal(state.displacement_fibre[:, 2], fibre)
        np.testing.assert_array_equal(state.displacement_matrix[:, 2], fibre + state.axial_jump)
        assert not state.axial_traction[state.status > 0].any()
    sheared = [state for state in states if "gamma13" in state.label or "gamma23" in state.label]
    assert len(sheared) * 2 < len(states) and all(not state.displacement.any() for state in sheared)
    return all(np.abs(state.axial_stress).max() > 1.0 for state in sheared)


def _areas(mesh: Any) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.points[mesh.triangles[:, :3]], 1, 0)
    return np.linalg.det(np.stack([b - a, c - a], axis=1)) / 2
