"""Build the cell of a result: elements, torn nodes, interface faces, and the scales of its states."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import AnyInt, Bool, Float, Int
from feti_homog.verify import torus
from feti_homog.verify.bonds import friction_at, pairs_of
from feti_homog.verify.constitutive_law import laws, mixed_phases
from feti_homog.verify.elements import Elements, add_at_nodes
from feti_homog.verify.findings import ROUNDING
from feti_homog.verify.reading import ResultFiles, State, Status, gradient

# Fraction of the terms to add to the scale of their sum; rounding is about 1e-15 of the terms.
ROUNDED_TERMS = 1e-5


class Scales(NamedTuple):
    """The scales of strains, stresses and displacements in a loaded cell with intact bonds."""

    strain: float
    stress: float
    displacement: float


@dataclass(frozen=True)
class Faces:
    """The b torn nodes on both faces of the k interface nodes.

    Attributes:
        row: (b,) interface node of a torn node, -1 if it has none.
        is_fibre: (b,) whether a torn node belongs to the inner body.
        copies: (b,) number of periodic images of a torn node in its subdomain.
        place, distance: (k,) place of an interface node, and its distance from the node; -1 and inf without a place.
        pair: (places,) section of the two bodies, if exactly two bodies meet along one line; else -1.
    """

    row: Int
    is_fibre: Bool
    copies: Int
    distance: Float
    pair: Int
    place: Int

    def sums(self, values: Float, of_fibre: bool) -> Float:
        """Sum values (b, c) over the copies on one face, the fibre face if `of_fibre`.  Returns sums (k, c)."""
        on_face = (self.row >= 0) & (self.is_fibre == of_fibre)
        k = len(self.place)
        return np.stack([np.bincount(self.row[on_face], column, k) for column in values[on_face].T], axis=1)

    def means(self, values: Float, of_fibre: bool) -> Float:
        """Average values (b, c) over the subdomains on a face, as in `sums`.  Returns (k, c), NaN without subdomain."""
        share = 1.0 / self.copies[:, None]
        with np.errstate(invalid="ignore"):
            return self.sums(values * share, of_fibre) / self.sums(np.ones_like(values) * share, of_fibre)


@dataclass(frozen=True)
class DiscreteCell:
    """The mesh, the materials and the interface of a result.

    Attributes:
        stiffnesses: (phases, v, v) stiffness of a phase, v = 3, or 6 in generalized plane strain and conduction.
        expansions: (phases, v) strain per temperature, 0 if unknown.
        constituent: (subdomains,) number of the connected part of a phase to which a subdomain belongs.
        inner: (s,) whether a torn side is the inner face of bonds that may break.
        fractions: (phases,) area fractions.
        largest_strain: largest strain component of all states.
    """

    files: ResultFiles
    stiffnesses: Float
    expansions: Float
    elements: Elements
    sides: torus.TornSides
    nodes: torus.TornNodes
    constituent: Int
    inner: Bool
    faces: Faces
    fractions: Float
    largest_strain: float

    @classmethod
    def of(cls, files: ResultFiles) -> Self:
        """Build the cell of a result.  Raises CaseError if a phase has no material."""
        mesh = files.mesh
        stiffnesses, free = laws(files.case, files.phases)
        elements = Elements(mesh, stiffnesses, mixed_phases(files.case, files.phases))
        sides, nodes, radius = torus.torn(mesh, files.size, files.shift)
        parts, inwards = torus.bodies(mesh, files.phases, sides)
        # Places where exactly two bodies meet along one line, and the section of their bonds.
        node_depth = inwards[parts[nodes.subdomain]]
        members = np.unique(np.column_stack([nodes.place, node_depth, nodes.phase]), axis=0)
        on_line = torus.along_one_line(sides, nodes, parts[mesh.subdomain])
        if files.boundary == "displacement":  # nodes on sides never part
            on_line[nodes.place[np.isin(nodes.node, sides.nodes[sides.on_side])]] = False
        two = np.flatnonzero((np.bincount(members[:, 0], minlength=nodes.places) == 2) & on_line)
        outer, last = np.searchsorted(members[:, 0], two), np.searchsorted(members[:, 0], two, side="right") - 1
        pairs, pair, innermost = pairs_of(files), np.full(nodes.places, -1), np.zeros(nodes.places, np.int64)
        pair[two], innermost[two] = pairs[members[outer, 2], members[last, 2]], members[last, 1]
        is_fibre = np.asarray((pair[nodes.place] >= 0) & (node_depth == innermost[nodes.place]))
        # The place nearest to each interface node.
        points, size, shift = files.interface.points, files.size, files.shift
        tree = cKDTree(torus.wrapped(mesh.points[nodes.node], shift), boxsize=shift)
        distance, nearest = tree.query(torus.wrapped(points, shift), distance_upper_bound=radius)
        place = np.append(nodes.place, -1)[nearest]
        row_of = np.full(nodes.places, -1)
        row_of[place[place >= 0]] = np.flatnonzero(place >= 0)
        labels = nodes.place * (int(nodes.subdomain.max(initial=0)) + 1) + nodes.subdomain
        _, which, count = np.unique(labels, return_inverse=True, return_counts=True)
        faces = Faces(row_of[nodes.place], is_fibre, count[which.ravel()], distance, pair, place)
        depth, other = inwards[parts[mesh.subdomain]], sides.element[sides.partner]
        may_part = (sides.partner >= 0) & (pairs[mesh.phase[sides.element], mesh.phase[other]] >= 0)
        inner = may_part & (depth[sides.element] > depth[other])
        fractions = np.bincount(mesh.phase, elements.area, len(files.phases)) / size.prod()
        strains = [np.abs(state.attrs["strain"]).max() for state in files.file.get("state", {}).values()]
        largest = float(np.max(strains, initial=0.0))
        return cls(files, stiffnesses, free, elements, sides, nodes, parts, inner, faces, fractions, largest)

    @property
    def area(self) -> float:
        """Return the area of the cell, voids included."""
        return float(self.files.size.prod())

    @property
    def porosity(self) -> float:
        """Return the area fraction of voids.  It is 0 if no torn side is at a void."""
        return 1.0 - float(self.fractions.sum()) if self.sides.at_void.any() else 0.0

    @cached_property
    def reuss(self) -> Float:
        """Compute <L^-1>^-1 (v, v) of the phase stiffnesses L.  It bounds the bonded cell's stiffness from below."""
        return np.asarray(np.linalg.inv(np.einsum("p,pij->ij", self.fractions, np.linalg.inv(self.stiffnesses))))

    @cached_property
    def inner_rows(self) -> Int:
        """Return the interface nodes (inner sides, 2 or 3) at the nodes of inner torn sides, -1 where none is."""
        row_of = np.full(len(self.files.mesh.points), -1)
        row_of[self.nodes.node] = self.faces.row
        return np.asarray(row_of[self.sides.nodes[self.inner]])

    def tips(self, status: AnyInt) -> Bool:
        """Return which nodes (k,) are tips: bonds beside a broken bond."""
        rows, broken, has_broken_neighbour = self.inner_rows, status != Status.BONDED, np.zeros(len(status), bool)
        pairs = (rows[:, [0, 2, 2, 1]] if rows.shape[1] == 3 else rows).reshape(-1, 2)
        pairs = pairs[(pairs >= 0).all(axis=1)].T
        for node, neighbour in (pairs, pairs[::-1]):
            has_broken_neighbour[node[broken[neighbour]]] = True
        return np.asarray(has_broken_neighbour & ~broken)

    @cached_property
    def directions(self) -> Float:
        """Compute directions (k,) in degrees from the fibre centres to the interface nodes; NaN without a centre."""
        rows = self.files.interface
        x, y = torus.from_centre(rows.points, self.files.fibres.centre[rows.fibre - 1], self.files.shift).T
        return np.asarray(np.degrees(np.arctan2(y, x)))

    @cached_property
    def bond_directions(self) -> Float:
        """Return `directions` (k,) in (-180, 180]; without a fibre centre, directions of normals."""
        n1, n2 = self.files.interface.normal.T
        angle = np.where(np.isnan(self.directions), np.degrees(np.arctan2(n2, n1)), self.directions)
        return np.asarray(angle + 360.0 * (angle <= -180.0 + ROUNDING))

    def in_axes(self, vectors: Float) -> Float:
        """Transform vectors (k, c) from components along normal n, tangent (-n2, n1) and fibre to x1, x2 and x3."""
        n1, n2 = self.files.interface.normal.T
        normal, tangential, *axial = vectors.T
        return np.stack([n1 * normal - n2 * tangential, n2 * normal + n1 * tangential, *axial], axis=1)

    @cached_property
    def void_integrals(self) -> Float:
        """Return `integrals` (n, 2) along the boundaries of voids."""
        return self.integrals(self.sides.at_void)

    @cached_property
    def side_integrals(self) -> Float:
        """Return `integrals` (n, 2) along the sides of a cell that is not periodic."""
        return self.integrals(self.sides.on_side)

    def integrals(self, which: Bool) -> Float:
        """Compute integrals int N_a n ds (nodes, 2) over the sides `which`: shape functions N_a, normals n inwards.

        On a side this is sum_b int N_a dN_b/ds x_b with nodes x_b, rotated to the normal.
        """
        sums, points = np.zeros_like(self.files.mesh.points), self.files.mesh.points
        nodes = self.sides.nodes[which]
        M = np.array([[-3, -1, 4], [1, 3, -4], [-4, 4, 0]]) / 6 if nodes.shape[1] == 3 else np.array([[-1, 1]] * 2) / 2
        add_at_nodes(sums, nodes, M @ points[nodes] @ np.array([[0, 1], [-1, 0]]))
        return sums

    def loads(self, strain: Float, temperature: float) -> Float:
        """Return a strain (v,) plus the largest thermal strain of any phase, as a scale."""
        return np.asarray(strain + np.abs(self.expansions * temperature).max(axis=0))

    def scales(self, strain: Float, temperature: float) -> Scales:
        """Compute the scales of a load; at least ROUNDING x the scales of the largest strain in all states."""
        loads, longest, (width, height) = self.loads(strain, temperature), float(self.files.size.max()), self.files.size
        corners = np.array([[width, 0.0], [0.0, height], [width, height]])
        displacement = float(np.abs(corners @ gradient(loads).T).max())
        displacement += abs(float(loads[2])) * longest if len(loads) > 3 else 0.0  # bounds the contraction by E33
        sizes = float(np.abs(loads).max()), float(np.abs(self.reuss @ loads).max()), displacement
        unit = ROUNDING * self.largest_strain  # a path may come back to strain 0
        return Scales(*map(max, sizes, (unit, unit * float(np.abs(self.reuss).max()), unit * longest)))

    @cached_property
    def _scales_on_path(self) -> list[Scales]:
        """Return the scales of all path points if there is friction, which keeps earlier rounding errors; else []."""
        points = self.files.document.get("path", ()) if friction_at(self.files).any() else ()
        return [self.scales(np.array(point["strain"]), float(point.get("temperature", 0.0))) for point in points]

    def scales_of(self, state: State) -> Scales:
        """Compute the scales of a state.  With friction they are the largest on the path up to the state."""
        sizes = [self.scales(state.strain, state.temperature), *self._scales_on_path[: state.point + 1]]
        return Scales(*map(max, zip(*sizes, strict=True)))

    def largest_displacement(self, state: State) -> float:
        """Compute a scale of displacements: the largest fluctuation plus the displacement E x."""
        return float(np.abs(state.fluctuation).max()) + self.scales_of(state).displacement

    @property
    def rounded_energy(self) -> float:
        """Return a floor (energy per area) for energy scales.  A cell without bonds stores only rounding errors."""
        return ROUNDED_TERMS * float(np.abs(self.reuss).max()) * self.largest_strain**2
