"""The cell of a result as the laws see it: its elements, its torn nodes, and the faces of its interfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.bonds import friction_at, inwardness, pairs_of
from feti_homog.verify.cell_tables import State, gradient
from feti_homog.verify.constitutive_law import laws, mixed_phases
from feti_homog.verify.elements import Elements
from feti_homog.verify.reading import ResultFiles
from feti_homog.verify.torus import TornNodes, TornSides, along_one_line, constituents, torn, wrapped

# Scales of a state are no less than this share of those of the run: a path may come back to zero strain.
LEAST_SHARE = 1e-9
# So much of the terms that a number is summed of counts as its scale: 1e-15 of the terms are rounding.
ROUNDED_TERMS = 1e-5


class Loaded(Protocol):
    """Object with a macroscopic strain (v,) and a change of temperature."""

    @property
    def strain(self) -> Float: ...

    @property
    def temperature(self) -> float: ...


@dataclass(frozen=True)
class Faces:
    """Torn nodes that make up the two faces at each of the k interface nodes.

    Attributes:
        row, is_fibre: (b,) the interface node at each torn node, or -1, and whether it is of the inner of two bodies.
        copies: (b,) how many copies of the torn node its subdomain has, periodic images of each other.
        distance, place: (k,) of each interface node from its place, and that; infinite and -1 if there is none.
        pair: (places,) place of the section of the two bodies that meet there alone and along one line; -1 where they
            never part.
    """

    row: Int
    is_fibre: Bool
    copies: Int
    distance: Float
    pair: Int
    place: Int

    def sums(self, values: Float, of_fibre: bool) -> Float:
        """(k, c) sums of values (b, c) over the copies on one of the faces."""
        own = (self.row >= 0) & (self.is_fibre == of_fibre)
        k = len(self.place)
        return np.stack([np.bincount(self.row[own], column, k) for column in values[own].T], axis=1)

    def means(self, values: Float, of_fibre: bool) -> Float:
        """(k, c) means of values (b, c) over the subdomains on one of the faces; NaN where there is none."""
        share = 1.0 / self.copies[:, None]
        with np.errstate(invalid="ignore"):
            return self.sums(values * share, of_fibre) / self.sums(np.ones_like(values) * share, of_fibre)


@dataclass(frozen=True)
class DiscreteCell:
    """Mesh, materials and interface of a result.

    Stiffnesses (phases, v, v), v = 3 or in generalized plane strain 6; expansions (phases, v), None if not known; parts
    of phases that subdomains belong to (subdomains,); which torn sides are inner faces of bonds that may break (s,);
    shares of phases (phases,); how near copies of a node are; the largest component of the strains of all states.
    """

    files: ResultFiles
    stiffnesses: Float
    expansions: Float | None
    elements: Elements
    sides: TornSides
    nodes: TornNodes
    constituent: Int
    inner: Bool
    faces: Faces
    fractions: Float
    radius: float
    largest_strain: float

    @classmethod
    def of(cls, files: ResultFiles) -> DiscreteCell:
        """Return the cell of a result. Raises CaseError if a phase has no material."""
        mesh = files.mesh
        stiffnesses, free = laws(files.case, files.phases)
        elements = Elements(mesh, stiffnesses, mixed_phases(files.case, files.phases))
        sides, nodes, radius = torn(mesh, files.size)
        parts = constituents(mesh, sides)
        inwards = inwardness(mesh, files.phases, sides, parts)
        on_line = along_one_line(sides, nodes, parts[mesh.subdomain])
        faces = _faces(files, nodes, on_line, parts, inwards, radius)
        depth, other = inwards[parts[mesh.subdomain]], sides.element[sides.partner]
        may_part = (sides.partner >= 0) & (pairs_of(files)[mesh.phase[sides.element], mesh.phase[other]] >= 0)
        inner = may_part & (depth[sides.element] > depth[other])
        areas = np.bincount(mesh.phase, elements.area, len(files.phases))
        strains = [np.abs(state.attrs["strain"]).max() for state in files.file.get("state", {}).values()]
        largest = float(np.max(strains, initial=0.0))
        return cls(
            files, stiffnesses, free, elements, sides, nodes, parts, inner, faces, areas / files.size.prod(), radius,
            largest,
        )  # fmt: skip

    @cached_property
    def beside(self) -> Int:
        """(e, 2) interface nodes that lie beside each other."""
        row_of = np.full(len(self.files.mesh.points), -1)
        row_of[self.nodes.node] = self.faces.row
        rows = row_of[self.sides.nodes[self.inner]]
        along = rows[:, [0, 2, 2, 1]] if rows.shape[1] == 3 else rows
        pairs = along.reshape(-1, 2)
        return np.asarray(pairs[(pairs >= 0).all(axis=1)])

    @property
    def porosity(self) -> float:
        """Share of the voids, 0 where no side is without a partner."""
        return 1.0 - float(self.fractions.sum()) if self.sides.at_void.any() else 0.0

    @cached_property
    def node_integrals(self) -> Float:
        """(n, 2) int dN/dx over all elements of each node, and over voids, where it is int N n ds."""
        return np.asarray(self.elements.node_integrals + self.void_integrals)

    @cached_property
    def void_integrals(self) -> Float:
        """(n, 2) int N n ds along the voids, by Gauss' rule of two points."""
        sums, points = np.zeros_like(self.files.mesh.points), self.files.mesh.points
        nodes = self.sides.nodes[self.sides.at_void]
        for t in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)):
            if nodes.shape[1] == 2:
                shapes, slopes = np.array([1 - t, t]), np.array([-1.0, 1.0])
            else:
                shapes = np.array([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
                slopes = np.array([4 * t - 3, 4 * t - 1, 4 - 8 * t])
            dx, dy = np.einsum("a,sad->ds", slopes, points[nodes])
            for column, part in enumerate((-dy, dx)):
                terms = 0.5 * part[:, None] * shapes
                sums[:, column] += np.bincount(nodes.ravel(), terms.ravel(), len(sums))
        return sums

    @property
    def area(self) -> float:
        """Area of the rectangle."""
        return float(self.files.size.prod())

    @property
    def reuss(self) -> Float:
        """(v, v) <L^-1>^-1, the least stiffness of the bonded cell."""
        return np.asarray(np.linalg.inv(np.einsum("p,pij->ij", self.fractions, np.linalg.inv(self.stiffnesses))))

    def free_strains(self, state: Loaded) -> Float | None:
        """(phases, v) strains of the phases without stress at the temperature of a state."""
        return None if self.expansions is None else self.expansions * state.temperature

    def loads(self, state: Loaded) -> Float:
        """(v,) strains that the loads of a state make, for scales: E, and the largest that temperature makes."""
        free = self.free_strains(state)
        own = state.strain if free is None else np.asarray(state.strain + np.abs(free).max(axis=0))
        slip = 0.0  # those that friction holds load an unloaded cell
        if isinstance(state, State) and friction_at(self.files).any():
            slip = float(np.abs(state.jump).max(initial=0.0))
        return np.asarray(own + np.copysign(slip / float(self.files.size.max()), own))

    def imposed(self, state: Loaded) -> float:
        """Largest displacement E x that a state imposes across the cell, at least that of a faint strain."""
        width, height = self.files.size
        corners, loads = np.array([[width, 0.0], [0.0, height], [width, height]]), self.loads(state)
        own = float(np.abs(corners @ gradient(loads).T).max())
        if len(loads) > 3:  # as much as E33 may contract
            own += abs(float(loads[2])) * float(self.files.size.max())
        return max(own, LEAST_SHARE * self.largest_strain * float(self.files.size.max()))

    def least_stress(self, state: Loaded) -> float:
        """Return a stress that a state makes in the bonded cell at least: a scale that debonding keeps."""
        own, most = np.abs(self.reuss @ self.loads(state)).max(), np.abs(self.reuss).max() * self.largest_strain
        return float(max(own, LEAST_SHARE * most))

    @property
    def rounded_energy(self) -> float:
        """Energy per area to add to the largest, for scales: where all has parted what is stored is rounding."""
        return ROUNDED_TERMS * float(np.abs(self.reuss).max()) * self.largest_strain**2

    def energy_terms(self, state: Loaded) -> float:
        """Energy per area of which what is stored is summed at least, be it none: that of the bonded cell."""
        return self.least_stress(state) * self.strain_size(state)

    def strain_size(self, state: Loaded) -> float:
        """Return the largest of the strains that the loads of a state make."""
        return max(float(np.abs(self.loads(state)).max()), LEAST_SHARE * self.largest_strain)


def _faces(files: ResultFiles, nodes: TornNodes, on_line: Bool, parts: Int, inwards: Int, radius: float) -> Faces:
    """Return where interface nodes are on the mesh, with `inwardness` (parts,) and `along_one_line` (places,)."""
    depth = inwards[parts[nodes.subdomain]]
    members = np.unique(np.column_stack([nodes.place, depth, nodes.phase]), axis=0)
    two = np.flatnonzero((np.bincount(members[:, 0], minlength=nodes.places) == 2) & on_line)
    outer, inner = np.searchsorted(members[:, 0], two), np.searchsorted(members[:, 0], two, side="right") - 1
    pair = np.full(nodes.places, -1)
    pair[two] = pairs_of(files)[members[outer, 2], members[inner, 2]]
    innermost = np.zeros(nodes.places, np.int64)
    innermost[two] = members[inner, 1]
    is_fibre = np.asarray((pair[nodes.place] >= 0) & (depth == innermost[nodes.place]))
    points, size = files.interface.points, files.size
    place, distance = np.full(len(points), -1), np.full(len(points), np.inf)
    if len(points) and len(nodes.node):
        tree = cKDTree(wrapped(files.mesh.points[nodes.node], size), boxsize=size)
        away, nearest = tree.query(wrapped(points, size), distance_upper_bound=radius)
        found = np.flatnonzero(np.isfinite(away))
        place[found], distance[found] = nodes.place[nearest[found]], away[found]
    row_of = np.full(nodes.places, -1)
    row_of[place[place >= 0]] = np.flatnonzero(place >= 0)
    _, which, count = np.unique(
        nodes.place * (int(nodes.subdomain.max(initial=0)) + 1) + nodes.subdomain,
        return_inverse=True, return_counts=True,
    )  # fmt: skip
    return Faces(row_of[nodes.place], is_fibre, count[which.ravel()], distance, pair, place)
