"""Solve the states of a result once more by SciPy: bodies, bonds and contact, assembled anew from result.h5.

It shares with the program the mesh, normals and lengths of the interfaces, which `verify` checks, which bonds hold and
which faces touch, and the slip of faces with friction, whose shear must obey Coulomb's law.
u = (u1, u2, u3) is u* of all nodes, one for each constituent at each place of the torus.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from reference.spatial_forms import law
from reference.spatial_programme import elements
from scipy.sparse import block_diag, bmat, coo_matrix, csr_matrix, diags, identity
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from differential.transforms import sections

IN_PLANE = [0, 1, 5]
NEAR = 1e-7  # of places / size of the cell
LEAST = 1e-3  # share of the stress of a uniform strain
FREE = 1e-11  # a stiffness, relative to the largest, of motions that nothing resists; bodies hang by more
REFINEMENTS = 12
OPEN, CLOSED, BONDED = 2, 1, 0


@dataclass(frozen=True)
class Twin:
    """Deviations of a state: stress and energy relative to their largest; of contact and friction by their laws."""

    stress: float
    energy: float
    contact: float
    friction: float


def phase_law(material: Any, plane: str) -> tuple[np.ndarray, np.ndarray]:
    """C (6, 6) and expansion (6,); of a plane state what acts in the plane, and anything along x3."""
    alpha = np.zeros(6)
    if np.shape(material.get("stiffness", ())) == (3, 3):
        L = np.array(material["stiffness"], float)
    else:
        C, own = law(material)
        if plane == "generalized":
            return C, alpha if own is None else own
        L = C[np.ix_(IN_PLANE, IN_PLANE)]
        if plane == "stress":
            L = np.linalg.inv(np.linalg.inv(C)[np.ix_(IN_PLANE, IN_PLANE)])
    C = np.eye(6) * L.max()
    C[np.ix_(IN_PLANE, IN_PLANE)] = L
    return C, alpha


class SolvedAnew:
    """The cell of a folder of results."""

    def __init__(self, folder: Path) -> None:
        self.document = json.loads((folder / "result.json").read_text())
        self.file = h5py.File(folder / "result.h5", "r")
        self.size = np.array([self.file.attrs["width"], self.file.attrs["height"]], float)
        self.plane = self.document["case"]["analysis"]["plane"]
        self._number_nodes()
        self._assemble()
        self._join_faces()

    def _number_nodes(self) -> None:
        """Assign numbers to the nodes: one for each phase at each place of the torus."""
        mesh = {name: self.file[f"mesh/{name}"][()] for name in ("points", "triangles", "phase")}
        self.points, self.triangles, self.phase = mesh["points"], mesh["triangles"], mesh["phase"]
        n = len(self.points)
        wrapped = np.mod(self.points / self.size, 1.0) % 1.0
        pairs = cKDTree(wrapped, boxsize=1.0).query_pairs(NEAR, output_type="ndarray")
        of_phase = np.zeros(n, int)
        of_phase[self.triangles] = self.phase[:, None]
        alike = pairs[of_phase[pairs[:, 0]] == of_phase[pairs[:, 1]]]
        self.place = components_of(n, pairs)
        self.node = components_of(n, alike)
        self.n = int(self.node.max()) + 1

    def _assemble(self) -> None:
        case, plane = self.document["case"], self.plane
        names = [str(name) for name in self.file.attrs["phases"]]
        K, Q, rows = [], np.zeros((3 * self.n, 7)), []
        self.mean = np.zeros((7, 7))
        for number, name in enumerate(names):
            own = self.triangles[self.phase == number]
            if not len(own):
                continue
            material = case["material"].get(name, case["material"].get(name.split(":")[0]))
            C, alpha = phase_law(material, plane)
            is_mixed = own.shape[1] == 6 and "young" in material and plane != "stress"
            k, q, area = elements(self.points[own], C, alpha, is_mixed)
            dofs = (3 * self.node[own][:, :, None] + np.arange(3)).reshape(len(own), -1)
            np.add.at(Q, dofs, q)
            K.append(k.ravel())
            width = dofs.shape[1]
            rows.append((np.repeat(dofs, width, axis=1).ravel(), np.tile(dofs, width).ravel()))
            imposed = np.column_stack([np.eye(6), -alpha])
            self.mean += area.sum() * imposed.T @ C @ imposed
        entries = np.concatenate(K), tuple(np.concatenate(x) for x in zip(*rows, strict=True))
        self.K = coo_matrix(entries, shape=(3 * self.n,) * 2).tocsr()
        self.Q = Q

    def _join_faces(self) -> None:
        """Find the faces of the interface nodes, and the other nodes that share one place."""
        own = self.file["interface"]
        self.fibre, self.matrix = (self.node[own[f"{side}_node"][()]] for side in ("fibre", "matrix"))
        normal, self.length = own["normal"][()], own["length"][()]
        self.k = len(self.length)
        zero = np.zeros(self.k)
        n, t = np.column_stack([normal, zero]), np.column_stack([-normal[:, 1], normal[:, 0], zero])
        self.frame = np.stack([n, t, np.tile([0.0, 0.0, 1.0], (self.k, 1))], axis=1).reshape(self.k, 3, 3)
        place_of = np.zeros(self.n, int)
        place_of[self.node] = self.place
        parted = np.isin(place_of, place_of[self.fibre])
        first = np.full(place_of.max() + 1, -1)
        first[place_of] = np.arange(self.n)
        self.joined = np.where(parted, np.arange(self.n), first[place_of])
        pair = own["pair"][()] if "pair" in own else np.zeros(self.k, int)
        self.springs = self._springs()[pair] if self.k else np.zeros((0, 3))
        rubbing = [(each.get("friction", 0.0), each.get("friction_on_damage", False))
                   for each in sections(self.document["case"]) or [{}]]  # fmt: skip
        self.friction, on_damage = np.array(rubbing, float)[pair].T if self.k else np.zeros((2, 0))
        self.rubs_on_damage = (on_damage > 0.0) & (self.friction > 0.0)

    def _springs(self) -> np.ndarray:
        """(sections, 3) stiffnesses of bonds, inf of glue."""
        found = []
        for section in sections(self.document["case"]) or [{}]:
            n, t = (section.get(f"{side}_stiffness") or np.inf for side in ("normal", "tangential"))
            found.append([n, t, section.get("axial_stiffness") or t])
        return np.array([[float(x) for x in row] for row in found])

    def compare(self, number: int) -> Twin:
        """Return the deviations of state `number`."""
        state = self.file[f"state/{number}"]
        status = state["status"][()]
        load, stress = self._loads(state)
        holds = np.column_stack([status != OPEN, status == BONDED, status == BONDED])
        rubs = (
            np.column_stack([np.zeros(self.k, bool), self.friction > 0.0, np.zeros(self.k, bool)])
            & (status == CLOSED)[:, None]
        )
        damage = state["damage"][()]
        softened = (status == BONDED) & (damage > 0.0)
        rubs[:, 1] |= softened & self.rubs_on_damage
        glued, sprung = holds & np.isinf(self.springs), holds & np.isfinite(self.springs)
        whole = glued.all(axis=1)
        jumps = self._jumps()
        pulled = state["traction"][:, 0] > 0.0
        kept = np.where(softened, 1.0 - damage, 1.0)
        kept = np.column_stack([np.where(pulled, kept, 1.0), kept, kept])
        springs = (np.where(sprung, kept * self.springs, 0.0) * self.length[:, None]).ravel()
        T = self._together(whole)
        held = (rubs | glued & ~whole[:, None]).ravel()
        C = (jumps[held] @ T).tocsr()
        K = self.K + jumps.T @ diags(springs) @ jumps
        slip = np.where(rubs, self._jump(state), 0.0).ravel()[held]
        u, force = _solved((T.T @ K @ T).tocsr(), C, -T.T @ (self.Q @ load), slip)
        u = T @ u
        jump = jumps @ u
        pull, rubbing = springs * jump, np.zeros(3 * self.k)
        rubbing[held] -= force
        pull += rubbing
        area = float(self.size.prod())
        found = (self.mean @ load + self.Q.T @ u) / area
        # Springs are in series with faces, and damaged shares of bonds, that rub.
        share = np.where(rubs, damage[:, None], 1.0)
        rubbing = np.where(rubs, rubbing.reshape(-1, 3), 0.0)
        rubbed = (rubbing**2 / (share * self.springs)).sum(axis=1)
        energy = (load @ self.mean @ load + u @ (K @ u) + (rubbed / self.length).sum()) / 2 + load @ self.Q.T @ u
        v = len(stress)
        found = found[:6] if v == 6 else found[IN_PLANE]
        size = max(np.abs(stress).max(), self._least(load))
        entry = self._entry(state)
        stored = entry.get("stored") if entry else None
        least = self._least(load) * _largest(load)
        off = 0.0 if stored is None else abs(energy / area - stored) / max(abs(stored), least)
        forces = pull.reshape(-1, 3)
        # Where faces bear next to nothing, as of a fibre that one of them touches, their forces are rounding.
        largest = max(np.abs(forces).max(initial=0.0), LEAST * size * self.length.max(initial=0.0)) or 1.0
        contact = self._contact(status, jump, forces / largest, entry)
        pressed = np.where(pulled, -forces[:, 0], forces[:, 0])[softened].max(initial=0.0) / largest
        sheared = self._rubbing(state, rubs, rubbing[:, 1] / largest, share[:, 1] * forces[:, 0] / largest)
        return Twin(float(np.abs(found - stress).max() / size), off, max(contact, float(pressed)), sheared)

    def _loads(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        strain, stress = (np.array(state.attrs[name], float) for name in ("strain", "stress"))
        load = np.zeros(7)
        load[:6] = strain if len(strain) == 6 else 0.0
        if len(strain) == 3:
            load[IN_PLANE] = strain
        load[6] = float(state.attrs.get("temperature", 0.0))
        return load, stress

    def _least(self, load: np.ndarray) -> float:
        """Return a stress by which small ones are measured, which are what is left of larger ones."""
        return LEAST * float(np.abs(self.mean[:6] @ load).max() / self.size.prod()) or 1.0

    def _entry(self, state: Any) -> Any:
        """Return the entry of result.json for a state of a path or a load."""
        if "path" in self.document:
            return self.document["path"][int(state.attrs["point"])]
        return self.document.get("load")

    def _jumps(self) -> csr_matrix:
        """(3k, 3n) rows n, t and x3 of u_matrix - u_fibre."""
        rows = np.repeat(np.arange(3 * self.k), 3)
        parts = []
        for node, sign in ((self.matrix, 1.0), (self.fibre, -1.0)):
            columns = np.repeat(3 * node[:, None] + np.arange(3), 3, axis=0).ravel()
            parts.append(csr_matrix((sign * self.frame.ravel(), (rows, columns)), shape=(3 * self.k, 3 * self.n)))
        return parts[0] + parts[1]

    def _together(self, whole: np.ndarray) -> csr_matrix:
        """(3n, free) displacements of all nodes from those of one of each joined set."""
        pairs = np.concatenate(
            [np.column_stack([np.arange(self.n), self.joined]), np.column_stack([self.fibre, self.matrix])[whole]]
        )
        number = components_of(self.n, pairs)
        count = int(number.max()) + 1
        one = csr_matrix((np.ones(self.n), (np.arange(self.n), number)), shape=(self.n, count))
        return block_diag([one] * 3).tocsr()[_interleaved(self.n)][:, _interleaved(count)]

    def _contact(self, status: Any, jump: Any, pull: Any, entry: Any) -> float:
        """Compute overlap / largest jump of open faces, and relative pull of closed ones, without free fibres."""
        contact = any(section.get("contact", False) for section in sections(self.document["case"]))
        if not contact or not self.k or not entry or entry.get("free_motions", 0):
            return 0.0
        gap, normal = jump.reshape(-1, 3)[:, 0], pull[:, 0]
        overlap = float(np.max(-gap[status == OPEN], initial=0.0)) / (np.abs(jump).max(initial=0.0) or 1.0)
        return max(overlap, float(np.max(normal[status == CLOSED], initial=0.0)))

    def _jump(self, state: Any) -> np.ndarray:
        """(k, 3) jumps that a result has."""
        along = state["axial_jump"][()] if "axial_jump" in state else np.zeros(self.k)
        return np.column_stack([state["jump"][()], along])

    def _rubbing(self, state: Any, rubs: np.ndarray, shear: np.ndarray, pull: np.ndarray) -> float:
        """Compute what shear exceeds mu p, or differs from it where faces slide, of relative forces (k,) that rub."""
        limit, own = self.friction * np.maximum(-pull, 0.0), rubs[:, 1]
        sign = state["sliding"][()]
        off = np.where(sign != 0, np.abs(sign * shear - limit), np.maximum(np.abs(shear) - limit, 0.0))
        return float(off[own].max(initial=0.0))


def _largest(load: np.ndarray) -> float:
    return float(np.abs(load[:6]).max()) or 1.0


def components_of(n: int, pairs: np.ndarray) -> np.ndarray:
    """(n,) number of the connected component of each of n."""
    ones = np.ones(len(pairs))
    return np.asarray(connected_components(coo_matrix((ones, pairs.T), shape=(n, n)), directed=False)[1])


def _interleaved(n: int) -> np.ndarray:
    """(3n,) places in [all u1, all u2, all u3] of dofs node by node."""
    return np.asarray((np.arange(n)[:, None] + n * np.arange(3)).ravel())


def _solved(K: Any, C: Any, f: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve K u - C^T force = f, C u = c by refinement from a little stiffness, which keeps free motions small."""
    m, n = C.shape
    scale = K.diagonal().max()
    borders = bmat([[K, -C.T * scale], [-C * scale, csr_matrix((m, m))]]).tocsc() if m else K.tocsc()
    more = block_diag([FREE * scale * identity(n), csr_matrix((m, m))]).tocsc() if m else FREE * scale * identity(n)
    factor = splu((borders + more).tocsc())
    b = np.r_[f, -scale * c]
    x = np.zeros(len(b))
    for _ in range(REFINEMENTS):
        x += factor.solve(b - borders @ x)
    return x[:n], x[n:] * scale
