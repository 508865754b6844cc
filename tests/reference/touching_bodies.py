"""Cells of straight triangles whose bodies touch at nodes, for the quadratic programme: sectors counted node by node.

Bodies part only where exactly two meet, along one line.  Shares nothing with the program: bodies, sectors, normals and
lengths are found here, in loops.
"""

from collections import Counter, defaultdict

import numpy as np

from reference.quadratic_programme import QuadraticProgramme, torus_keys


class TouchingBodies(QuadraticProgramme):
    """The unit square of `points` (n, 2) and `triangles` (m, 3) in phases (m,), 0 the matrix.

    Their stiffnesses are L (phases, 3, 3).

    `held` has the keys of the places where two bodies meet and never part, `ends` (k, 2 p) the keys of the edges' ends.
    """

    def __init__(self, points, triangles, phase, L):
        points, size = np.asarray(points), np.ones(2)
        self._keys = torus_keys(points, size)[triangles]
        self._corners, self._phase = points[triangles], np.asarray(phase)
        self._body = self._bodies()
        meeting, parting = defaultdict(set), set()
        for t, keys in enumerate(self._keys.tolist()):
            for key in keys:
                meeting[key].add(t)
        for key, around in meeting.items():
            if self._parts(key, around):
                parting.add(key)
        several = {key for key, around in meeting.items() if len({self._body[t] for t in around}) > 1}
        self.held = several - parting
        labels = np.where(np.isin(self._keys, sorted(parting)), self._body[:, None], -1)
        parts = [
            (corners, np.arange(3)[None], label, int(own > 0), L[own], False)
            for corners, label, own in zip(self._corners, labels, self._phase, strict=True)
        ]
        super().__init__(parts, np.zeros((0, 2)), np.zeros((0, 0)), size)

    def _sides(self):
        """Return {the sides' ends, keys in order: [(triangle, k), ...]}."""
        sides = defaultdict(list)
        for t, keys in enumerate(self._keys.tolist()):
            for k in range(3):
                middle = torus_keys((self._corners[t, k] + self._corners[t, (k + 1) % 3])[None] / 2, np.ones(2))[0]
                sides[(*sorted((keys[k], keys[(k + 1) % 3])), int(middle))].append((t, k))
        return sides

    def _bodies(self):
        """(m,) the connected part of a phase that each triangle is in."""
        self._beside = defaultdict(set)
        body = np.arange(len(self._keys))
        self._shared = {ends: own for ends, own in self._sides().items() if len(own) == 2}
        for ends, ((t, _), (s, _)) in self._shared.items():
            for end in ends[:2]:
                self._beside[end].add((t, s))
            if self._phase[t] == self._phase[s]:
                body[body == body[s]] = body[t]
        return body

    def _parts(self, key, around):
        """Return True if the triangles `around` a place are of two bodies, a sector each, with an edge in common."""
        sector = {t: t for t in around}
        for t, s in self._beside[key]:
            if self._body[t] == self._body[s]:
                old, new = sector[s], sector[t]
                sector = {r: new if own == old else own for r, own in sector.items()}
        bodies = Counter(self._body[t] for t in set(sector.values()))
        edges = any(self._body[t] != self._body[s] for t, s in self._beside[key])
        return len(bodies) == 2 and set(bodies.values()) == {1} and edges

    def _place(self, depth, centres, radii):
        """Find normals and lengths of the interface nodes, and their edges."""
        place = {key: number for number, key in enumerate(self.key.tolist())}
        self.normal, self.lengths = np.zeros((len(place), 2)), np.zeros(len(place))
        self.edges = defaultdict(set)
        for ends, own in self._shared.items():
            inner = [(t, k) for t, k in own if self._phase[t] > 0]
            if len(inner) == 1:
                ((t, k),) = inner
                along = self._corners[t, (k + 1) % 3] - self._corners[t, k]
                for end in {*ends[:2]} & place.keys():
                    self.normal[place[end]] += along[1] / 2, -along[0] / 2
                    self.lengths[place[end]] += np.hypot(*along) / 2
                    self.edges[end].add(ends[:2])
        self.normal /= np.hypot(*self.normal.T)[:, None]

    def bonded(self, lines):
        """(k,) which nodes hold if the edges between these pairs of points, ((x, y), (x, y)), are debonded."""
        keys = {tuple(sorted(torus_keys(np.array(pair), self.size).tolist())) for pair in lines}
        return np.array([not self.edges[key] <= keys for key in self.key.tolist()])
