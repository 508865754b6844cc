"""Compute strains, stresses and forces of triangles with three or six nodes, only for the certificate.

Displacements have c = 2 components, or 3 in generalized plane strain and conduction; strains and stresses have v = 3 or
6, in the orders [11, 22, 12] and [11, 22, 33, 23, 13, 12].  In barycentric coordinates r, the shape functions are N_a =
r_a, or r_a (2 r_a - 1) and 4 r_a r_b in isoparametric elements.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.reading import Mesh

ELEMENTS_AT_ONCE = 1 << 15
# (c, 2) position of du_i/dx_d in the strains, by the number of strains.
PLACES = {3: np.array([[0, 2], [2, 1]]), 6: np.array([[0, 5], [5, 1], [4, 3]])}
# r_a is N_a plus half of N_b for the middle nodes b of both sides at vertex a.
OF_NODES = np.array([[2, 0, 0, 1, 0, 1], [0, 2, 0, 1, 1, 0], [0, 0, 2, 0, 1, 1]]) / 2
# Components of normal stresses, by the number of stresses.
NORMAL = {3: [0, 1], 6: [0, 1, 2]}


@dataclass(frozen=True)
class ElementFields:
    """The fields of m elements that follow from displacements (n, c).

    Attributes:
        strain, stress: (m, v) element means.
        strain_size: (m,) size of the terms whose sum is the strain, which bounds the rounding.
        force: (n, c) nodal forces int B^T sigma for strains B u.
        force_size: (n,) size of the terms whose sum is the force.
        largest_force: largest nodal force of a single element.
        energy: int sigma : eps.
    """

    strain: Float
    stress: Float
    strain_size: Float
    force: Float
    force_size: Float
    largest_force: float
    energy: float


class Elements:
    """The elements of a mesh.  Quadratic elements of `mixed` phases have a bubble and a pressure."""

    def __init__(self, mesh: Mesh, stiffnesses: Float, mixed: Bool) -> None:
        self._mesh, self._stiffnesses = mesh, stiffnesses
        self.mixed = mixed & (mesh.triangles.shape[1] == 6)

    @property
    def contrasts(self) -> tuple[float, float]:
        """Return the largest lambda / mu (Lame's constants) and max(mu) / mu of mixed phases; (0, 0) without any."""
        L, mu = self._stiffnesses[self.mixed], self._stiffnesses[:, -1, -1]
        ratio, contrast = L[:, 0, 1] / L[:, -1, -1], mu.max() / mu[self.mixed]
        return float(ratio.max(initial=0.0)), float(contrast.max(initial=0.0))

    @cached_property
    def area(self) -> Float:
        """Return the element areas (m,), negative for inverted elements."""
        return np.concatenate([weights.sum(axis=1) for _, _, weights in self._parts()])

    @cached_property
    def least_jacobian(self) -> Float:
        """Compute the least quadrature weight of an element over its |mean weight| (m,), positive in valid elements."""
        parts = [weights / np.abs(weights.mean(axis=1))[:, None] for _, _, weights in self._parts()]
        return np.concatenate([part.min(axis=1) for part in parts])

    @cached_property
    def node_integrals(self) -> Float:
        """Compute integrals int dN_a/dx (n, 2) of shape function gradients over the elements at each node a."""
        sums = np.zeros_like(self._mesh.points)
        for part, gradients, weights in self._parts():
            add_at_nodes(sums, self._mesh.triangles[part], np.einsum("eqad,eq->ead", gradients, weights))
        return sums

    def fields(self, displacement: Float, terms_of_u: Float, along: float, free: Float) -> ElementFields:
        """Compute the fields of displacements (n, c).

        `terms_of_u` (n, c): sizes of the terms in u; `along`: as in `State`; `free` (phases, v): thermal strains.
        """
        m, v = len(self._mesh.triangles), self._stiffnesses.shape[1]
        strain, stress, size = np.empty((m, v)), np.empty((m, v)), np.empty(m)
        force, terms, largest, energy = np.zeros_like(displacement), np.zeros_like(self._mesh.points), 0.0, 0.0
        for part, gradients, weights, slope, local, answer in self.responses(displacement, along, free):
            nodes, phase = self._mesh.triangles[part], self._mesh.phase[part]
            share = weights / weights.sum(axis=1)[:, None]
            strain[part], stress[part] = (np.einsum("eqi,eq->ei", field, share) for field in (local, answer))
            size[part] = np.einsum("eqad,eai->eq", np.abs(gradients), terms_of_u[nodes]).max(axis=1)
            # |du/dx| sum |x_a| |dN_a/dx|: coordinates have rounding, which matters most in small elements.
            lengths = np.einsum("eqad,ead->eq", np.abs(gradients), np.abs(self._mesh.points)[nodes])
            size[part] += (np.abs(slope).max(axis=(2, 3)) * lengths).max(axis=1) + abs(along)
            size[part] += np.abs(free[phase]).max(axis=1)
            forces = np.einsum("eqad,eqid,eq->eai", gradients, answer[..., PLACES[v]], weights, optimize=True)
            add_at_nodes(force, nodes, forces)
            rounded = np.abs(self._stiffnesses).max(axis=(1, 2))[phase] * size[part]
            add_at_nodes(terms, nodes, np.einsum("eqad,eq,e->ead", np.abs(gradients), weights, rounded, optimize=True))
            largest = max(largest, float(np.abs(forces).max()))
            energy += float(np.einsum("eqi,eqi,eq->", answer, local, weights, optimize=True))
        return ElementFields(strain, stress, size, force, terms.max(axis=1), largest, energy)

    def responses(
        self, displacement: Float, along: float, free: Float
    ) -> Iterator[tuple[slice, Float, Float, Float, Float, Float]]:
        """Yield slices, gradients and weights as in `_parts`, du/dx (e, q, c, 2), strains and stresses (e, q, v)."""
        v = self._stiffnesses.shape[1]
        for part, gradients, weights in self._parts():
            phase = self._mesh.phase[part]
            slope = np.einsum("eqad,eai->eqid", gradients, displacement[self._mesh.triangles[part]])
            local, thermal = _strains(slope, v, along), free[phase]
            excess, mixed = np.zeros(local.shape[:2]), np.flatnonzero(self.mixed[phase])
            if len(mixed):  # the excess is the pressure minus lambda tr eps; bubbles add to the strains
                lame = np.stack([self._stiffnesses[phase[mixed], 0, 1], self._stiffnesses[phase[mixed], -1, -1]], 1)
                elastic = local[mixed] - thermal[mixed, None]
                inner, pressure = inner_fields(gradients[mixed], weights[mixed], elastic, lame)
                bubble = _strains(inner, v, 0.0)
                local[mixed] += bubble
                excess[mixed] = pressure - lame[:, :1] * (elastic + bubble)[..., NORMAL[v]].sum(axis=2)
            answer = np.einsum("eij,eqj->eqi", self._stiffnesses[phase], local - thermal[:, None])
            answer[..., NORMAL[v]] += excess[..., None]
            yield part, gradients, weights, slope, local, answer

    def _parts(self) -> Iterator[tuple[slice, Float, Float]]:
        """Yield slices of elements, with gradients dN_a/dx (e, q, a, 2) and quadrature weights (e, q).

        Linear elements have one point, quadratic elements Dunavant's rule of degree 4 (1985) at `quadrature_points`.
        """
        shares, slopes = np.ones(1), np.eye(3)[None]  # weights with sum 1; dN_a/dr_b (q, a, 3)
        if self._mesh.triangles.shape[1] == 6:
            root, r = np.sqrt(213125 - 53320 * np.sqrt(10.0)), quadrature_points()
            shares, slopes = (620 + root * np.repeat([1.0, -1.0], 3)) / 3720, np.zeros((6, 6, 3))
            for a, b in ((0, 1), (1, 2), (2, 0)):
                slopes[:, a, a] = 4 * r[:, a] - 1
                slopes[:, 3 + a, a], slopes[:, 3 + a, b] = 4 * r[:, b], 4 * r[:, a]
        # r_0 = 1 - r_1 - r_2, so the columns of the Jacobian are dx/dr_1 - dx/dr_0 and dx/dr_2 - dx/dr_0.
        free = slopes[:, :, 1:] - slopes[:, :, :1]
        for first in range(0, len(self._mesh.triangles), ELEMENTS_AT_ONCE):
            part = slice(first, first + ELEMENTS_AT_ONCE)
            jacobian = np.einsum("qas,ead->eqds", free, self._mesh.points[self._mesh.triangles[part]])
            (a, b), (c, d) = np.moveaxis(jacobian, (2, 3), (0, 1))
            determinant = a * d - b * c
            adjugate = np.moveaxis(np.array([[d, -b], [-c, a]]), (0, 1), (2, 3))
            # In an element with area 0 no gradient is finite, so that its laws fail.
            gradients = np.einsum("qas,eqsd->eqad", free, adjugate / determinant[..., None, None])
            yield part, gradients, determinant * shares / 2


@cache
def quadrature_points() -> Float:
    """Return barycentric points (6, 3), cycles of (1 - 2 b, b, b): 18 b = 8 - sqrt(10) +- sqrt(38 - 44 sqrt(2/5))."""
    spread, places = np.sqrt(38 - 44 * np.sqrt(0.4)), []
    for sign in (1.0, -1.0):
        b = (8 - np.sqrt(10.0) + sign * spread) / 18
        places += [np.roll([1 - 2 * b, b, b], turn) for turn in range(3)]
    return np.array(places)


def _strains(slope: Float, v: int, along: float) -> Float:
    """Compute strains (e, q, v) from du_i/dx_d (e, q, c or 2, 2) and E33 = `along`."""
    local = np.zeros((*slope.shape[:2], v))
    for (i, d), place in np.ndenumerate(PLACES[v][: slope.shape[2]]):
        local[..., place] += slope[..., i, d]
    if along:
        local[..., 2] = along
    return local


def add_at_nodes(sums: Float, nodes: Int, values: Float) -> None:
    """Add values (e, a, c) to sums (n, c) at the nodes (e, a)."""
    for direction in range(values.shape[2]):
        sums[:, direction] += np.bincount(nodes.ravel(), values[..., direction].ravel(), len(sums))


def inner_fields(gradients: Float, weights: Float, strain: Float, lame: Float) -> tuple[Float, Float]:
    """Compute du_i/dx_d (e, q, 2, 2) of the bubbles b, and the pressures p (e, q), which are linear.

    They solve int sigma grad b = 0 and int r_a (p - lambda tr eps) = 0.  Arguments: dN_a/dx (e, q, 6, 2), weights
    (e, q), elastic strains (e, q, v) without bubbles, lambda and mu (e, 2).
    """
    (lam, mu), places = lame.T, quadrature_points()
    slopes = np.einsum("ab,eqbd->eqad", OF_NODES, gradients)
    bubble = np.einsum("qa,eqad->eqd", places[:, [1, 2, 0]] * places[:, [2, 0, 1]], slopes)  # gradients of the bubble
    square = np.einsum("eq,eqd,eqk->edk", weights, bubble, bubble)
    moment = np.einsum("eq,qm,eqd->emd", weights, places, bubble)
    matrix, right = np.zeros((len(weights), 5, 5)), np.zeros((len(weights), 5, 1))
    matrix[:, :2, :2] = square + np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    # The unknown is pressure / mu, so that both equations have the unit of strains.
    matrix[:, :2, 2:], matrix[:, 2:, :2] = moment.transpose(0, 2, 1), (lam / mu)[:, None, None] * moment
    matrix[:, 2:, 2:] = -np.einsum("eq,qm,qn->emn", weights, places, places)
    e11, e22, e12 = (strain[..., k] for k in (0, 1, -1))
    pulled = np.stack([2 * e11 * bubble[..., 0] + e12 * bubble[..., 1],
                       2 * e22 * bubble[..., 1] + e12 * bubble[..., 0]], axis=-1)  # fmt: skip
    right[:, :2, 0] = -np.einsum("eq,eqi->ei", weights, pulled)
    trace = strain[..., NORMAL[strain.shape[2]]].sum(axis=2)
    right[:, 2:, 0] = -(lam / mu)[:, None] * np.einsum("eq,qm,eq->em", weights, places, trace)
    solution = np.linalg.solve(matrix, right)[..., 0]
    return np.einsum("ei,eqd->eqid", solution[:, :2], bubble), mu[:, None] * (solution[:, 2:] @ places.T)
