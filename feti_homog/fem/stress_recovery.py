"""Recover stresses in the subdomains, and compute the energy of their difference from the element stresses.

After Zienkiewicz and Zhu (IJNME 33 (1992) 1331), a polynomial of the element order is fitted about every vertex to the
stresses at the integration points of the surrounding elements.  Barycentric coordinates blend the three vertex fits of
a quadratic element, or the fit values at the vertices of a linear element.  A subdomain has one phase, so that no fit
reaches across an interface, where stresses jump.  A fit includes all body pieces around its vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from feti_homog.fem.assembly import ELEMENTS_AT_ONCE
from feti_homog.fem.local_fits import KnownTractions, PatchNeighbours, fitted, gathered, linear_values, polynomials
from feti_homog.fem.problem import Problem
from feti_homog.fem.shape_functions import BARYCENTRIC, MixedElements, gradients, shape_functions, slopes, strains
from feti_homog.mesh import FineMesh
from feti_homog.typing import Float, Int, Int32

# Number of linear elements in a chunk, small enough for the processor cache.
LINEAR_AT_ONCE = 1 << 12


@dataclass(frozen=True)
class ElementStresses:
    """The stresses at q points in a slice of elements, under k loads.

    Attributes: element slice `part`, integration `points` (e, q, 2), their `weights` (e, q), `stress` (e, q, m, k).
    """

    part: slice
    points: Float
    weights: Float
    stress: Float


@dataclass(frozen=True)
class RecoveredStress:
    """The element stresses and the recovered stresses under k loads, in subdomains of one phase.

    Attributes:
        points, node_class: (n, 2) positions and (n,) classes of the plane nodes.
        triangles: (e, 3 or 6) plane nodes of the elements.
        L, problem: as in `Subdomain`; m displacement strains, v loads.
        u: (classes, c, k) fluctuating displacements.
        loads: (v, k) macroscopic strains and other loads.
        is_mixed: whether the elements have a bubble and a pressure.
        known: tractions that the recovered stresses in linear elements match, or None.
        shared: vertex classes (s,), and p coefficients (s, p, m k) of fits across body pieces, or None.
    """

    points: Float
    triangles: Int32
    node_class: Int32
    L: Float
    problem: Problem
    u: Float
    loads: Float
    is_mixed: bool = False
    known: KnownTractions | None = None
    shared: tuple[Int, Float] | None = None

    @classmethod
    def on(
        cls, mesh: FineMesh, L: Float, problem: Problem, u: Float, loads: Float, is_mixed: bool = False
    ) -> RecoveredStress:
        """Set up the stress recovery on one mesh; arguments are like the attributes."""
        return cls(mesh.points, mesh.triangles, mesh.node_class, L, problem, u, loads, is_mixed)

    @property
    def order(self) -> int:
        """Return the polynomial order of elements and fits."""
        return 1 if self.triangles.shape[1] == 3 else 2

    @cached_property
    def _rows(self) -> Int:
        """Return the plane nodes (3, e) at the element vertices."""
        return np.ascontiguousarray(self.triangles[:, :3].T, np.int64)

    @cached_property
    def _coordinates(self) -> Float:
        """Return the plane node coordinates (2, n)."""
        return self.points.T.copy()

    @cached_property
    def vertices(self) -> Int:
        """Return the vertex numbers (e, 3) of the elements.  Periodic images share a number."""
        return np.asarray(np.take(self.numbers, np.take(self.node_class, self._rows)).T)

    @cached_property
    def numbers(self) -> Int:
        """Return the vertex number of every node class (classes,), counted from 0; meaningless at mid-side nodes."""
        is_vertex = np.zeros(len(self.u), bool)
        is_vertex[self.node_class[self.triangles[:, :3]]] = True
        return np.asarray(np.cumsum(is_vertex) - 1)

    @cached_property
    def flexibility(self) -> Float:
        """Return the inverse (m, m) of the stiffness for displacement strains."""
        m = self.problem.strains
        return np.asarray(np.linalg.inv(self.L[:m, :m]))

    @cached_property
    def elements(self) -> list[ElementStresses]:
        """Return the element stresses at the integration points, in chunks."""
        at_once, compute = (LINEAR_AT_ONCE, self._uniform) if self.order == 1 else (ELEMENTS_AT_ONCE, self._varying)
        size = len(self.triangles)
        return [compute(slice(first, min(first + at_once, size))) for first in range(0, size, at_once)]

    def _varying(self, part: slice) -> ElementStresses:
        """Compute the stresses at the integration points in quadratic elements."""
        m, nodes = self.problem.strains, self.triangles[part]
        corners, u = self.points[nodes], self.u[self.node_class[nodes]]
        if self.is_mixed:
            elements = MixedElements.of(corners, self.L)
            stress, weights = elements.stress(elements.with_bubble(u)), elements.weights
        else:
            g, weights = gradients(corners)
            stress = self.L[:m, :m] @ strains(slopes(g, u), self.problem)
        points = shape_functions(BARYCENTRIC) @ corners
        return ElementStresses(part, points, weights, stress + self.L[:m] @ self.loads)

    def _uniform(self, part: slice) -> ElementStresses:
        """Compute the uniform stresses in linear elements, at the element centres."""
        (c, k), m, triangles = self.u.shape[1:], self.problem.strains, self._rows[:, part]
        x, y = (np.take(row, triangles) for row in self._coordinates)
        by_node = self.u.reshape(len(self.u), -1).T.copy()
        zero, first, second = (np.take(by_node, row, axis=1) for row in np.take(self.node_class, triangles))
        first -= zero
        second -= zero
        (x1, x2), (y1, y2) = x[1:] - x[0], y[1:] - y[0]
        doubled = x1 * y2 - x2 * y1
        slopes = (y2 * first - y1 * second) / doubled, (x1 * second - x2 * first) / doubled
        gradient, strain = [row.reshape(c, k, -1) for row in slopes], np.zeros((m, k, len(doubled)))
        for (i, d), number in np.ndenumerate(self.problem.voigt):
            strain[number] += gradient[d][i]
        stress = (self.L[:m, :m] @ strain.reshape(m, -1)).reshape(m * k, -1)
        stress += (self.L[:m] @ self.loads).reshape(-1, 1)
        points = np.stack([row.sum(axis=0) / 3 for row in (x, y)], axis=1)
        ordered = np.ascontiguousarray(stress.T).reshape(-1, 1, m, k)
        return ElementStresses(part, points[:, None], doubled[:, None] / 2, ordered)

    @cached_property
    def fits(self) -> Float:
        """Compute the coefficients (vertices, p, m k) of `polynomials` about vertices; p = 1 for linear elements."""
        neighbours = PatchNeighbours.of(self.vertices, self.points[self.triangles[:, :3]])
        if self.order == 1:
            chunks = [(chunk.points[:, 0], chunk.weights[:, 0], chunk.stress[:, 0]) for chunk in self.elements]
            points, weights, stress = map(np.concatenate, zip(*chunks, strict=True))
            away = np.stack([row - np.take(x, self._rows) for row, x in zip(points.T, self._coordinates, strict=True)])
            values = linear_values(self.vertices.T, away, weights, stress.reshape(len(stress), -1), neighbours)
            values = self._with_shared(values[:, None])[:, 0]
            if self.known is not None:
                tensors = values.reshape(-1, *stress.shape[1:])
                at = self.numbers[self.known.node]
                values = self.known.imposed(tensors, at, self.problem.voigt, self.flexibility).reshape(values.shape)
            return values[:, None]
        patches = self.patch_sums()
        pairs = zip(patches, neighbours.shared(*patches, self.order), strict=True)
        return self._with_shared(fitted(*(own + added for own, added in pairs)))

    def patch_sums(self) -> tuple[Float, Float]:
        """Sum w P^T P (vertices, p, p) and w P^T sigma (vertices, p, m k): weights w, `polynomials` P at a vertex."""
        moments, sums, size = np.zeros(()), np.zeros(()), int(self.vertices.max()) + 1
        for chunk in self.elements:
            corners = self.points[self.triangles[chunk.part, :3]]
            basis = polynomials(chunk.points[:, None] - corners[:, :, None], self.order)
            weighted = (basis * chunk.weights[:, None, :, None]).transpose(0, 1, 3, 2)
            stress = chunk.stress.reshape(len(corners), 1, chunk.points.shape[1], -1)
            moments = moments + gathered(self.vertices[chunk.part], weighted @ basis, size)
            sums = sums + gathered(self.vertices[chunk.part], weighted @ stress, size)
        return moments, sums

    def _with_shared(self, fits: Float) -> Float:
        """Replace the fits (vertices, p, m k) at shared vertices by the shared fits, in place; return the fits."""
        if self.shared is not None:
            fits[self.numbers[self.shared[0]]] = self.shared[1][:, : fits.shape[1]]
        return fits

    def recovered(self, part: Int | slice, lam: Float) -> Float:
        """Evaluate the recovered stresses (e, q, m, k) in elements, at barycentric coordinates lam (q, 3)."""
        vertices, shape = self.vertices[part], (self.problem.strains, self.loads.shape[1])
        if self.order == 1:
            return np.asarray((lam @ self.fits[:, 0][vertices]).reshape(len(vertices), len(lam), *shape))
        corners = self.points[self.triangles[part]]
        points, result = shape_functions(lam) @ corners, np.zeros(())
        for k in range(3):
            basis = polynomials(points - corners[:, None, k], self.order)
            result = result + (lam[:, k, None] * basis) @ self.fits[vertices[:, k]]
        return result.reshape(*points.shape[:2], *shape)

    def difference(self, weights: Float | None = None) -> tuple[Float, Float]:
        """Compute the energy products of the difference ds between recovered and element stresses.

        Returns int ds_i : S : ds_j (k, k), with the flexibility S and element `weights` (e,), by default 1, and the
        diagonal (e, k) by element, without weights.
        """
        m, k = self.problem.strains, self.loads.shape[1]
        total, shares = np.zeros((k, k)), [np.zeros((0, k))]
        root = np.kron(np.linalg.cholesky(self.flexibility), np.eye(k))
        for chunk in self.elements:
            # Differences (q, e, m, k) at points in the elements, times the roots of the weights.
            if self.order == 2:
                difference = self.recovered(chunk.part, BARYCENTRIC) - chunk.stress
                difference = (difference * np.sqrt(chunk.weights)[..., None, None]).swapaxes(0, 1)
            else:
                # With the values d_i of the linear difference d at the vertices, and their sum s:
                # int d d = w/12 (sum_i d_i d_i + s s) = w/12 sum_i (d_i + s/3)^2.
                e = len(chunk.stress)
                difference = np.empty((3, e, m * k))
                corners = self.vertices[chunk.part].T
                np.take(self.fits[:, 0], corners, axis=0, out=difference, mode="clip")  # clip needs no buffer
                difference += (difference[0] + difference[1] + difference[2]) / 3 - 2 * chunk.stress.reshape(e, m * k)
                difference = (difference * np.sqrt(chunk.weights / 12)).reshape(3, e, m, k)
            difference = (difference.reshape(-1, m * k) @ root).reshape(difference.shape)
            flat = difference.reshape(-1, k)
            weighted = flat if weights is None else (difference * weights[chunk.part, None, None]).reshape(-1, k)
            total += flat.T @ weighted
            shares.append(np.einsum("qemk,qemk->ek", difference, difference))
        return total, np.concatenate(shares)
