"""Paths of events once more, state by state: the cell of `twin` condensed to its interfaces by SciPy and clarabel.

It shares with the program the mesh, normals and lengths of the interfaces, and with `verify`, whose formulas are not
those of the solver, the laws of the bonds.
"""

from pathlib import Path
from typing import Any

import numpy as np
from reference.condensed_cell import CondensedCell, MixedLoad
from reference.mixed_path import MixedPath
from scipy.sparse import csr_matrix, identity, kron

from differential.paths import paths_apart
from differential.random_cases import Drawn
from differential.random_softening import softens
from differential.setting import Compared, Setting
from differential.transforms import sections
from differential.twin import BONDED, IN_PLANE, SolvedAnew, components_of
from feti_homog.verify.bonds import law_at
from feti_homog.verify.reading import ResultFiles, opened

# Unknowns of the condensed cell, and its states: an event of a later leg takes about fifty.
MOST_JUMPS, MOST_STATES, PER_EVENT = 130, 500, 50
COMPARED = (
    "load_factor", "strain", "stress", "temperature", "broke", "softened", "bonded", "stored", "stored_in_springs",
    "dissipated", "dissipated_strain_controlled", "fracture_energy",
)  # fmt: skip


def is_affordable(drawn: Drawn, base: Any) -> bool:
    """Return True of short paths of events in small cells, whose bonds the condensed cell has."""
    if drawn.analysis != "path" or drawn.document["path"].get("method") == "increments":
        return False
    own = sections(base["case"])
    if any(s.get("friction") or s.get("growth") == "released" for s in own):
        return False
    path, legs = base["path"], len(base["case"]["path"].get("waypoints", [0]))
    later = sum(point["load_factor"] * legs > 1.0 for point in path)
    nodes = sum(path[0][name] for name in ("bonded", "open", "closed"))
    alike = len({"normal_stiffness" in s for s in own}) == 1
    small = nodes * (3 if drawn.plane == "generalized" else 2) <= MOST_JUMPS
    return alike and small and len(path) + PER_EVENT * later <= MOST_STATES


def by_brute_force(setting: Setting) -> Compared:
    """Events of a path by an active-set search of its own in a condensed cell."""
    return points_compared(setting.base, followed(setting.drawn, setting.base, setting.files), setting.files)


def points_compared(base: Any, points: list[dict[str, Any]], folder: Path) -> Compared:
    """Return what the points of a path are off; `folder` has the files of the base."""
    names = [name for name in COMPARED if name in points[0]]
    own = base | {"path": [{name: point[name] for name in names} for point in base["path"]]}
    found, note = paths_apart(own, {"path": points}, folder)
    return Compared(*max(found), note)


def followed(drawn: Drawn, base: Any, folder: Path) -> list[dict[str, Any]]:
    """Return the points of the path of a case whose result is in a folder."""
    twin = SolvedAnew(folder)
    status = twin.file["state/0/status"][()]
    twin.file.close()
    loads = [MixedLoad.named(target) for target in drawn.case.targets]
    springs = twin.springs if np.isfinite(twin.springs).all() else None
    contact = any(section["contact"] for section in sections(base["case"]))
    cell = CondensedCell(Torn(twin, len(loads[0].values)), contact, springs)
    with opened(folder) as files:
        path = Teeth(cell, files, softens(drawn.document), status == BONDED)
        events = path.follow(loads)
    return [path.point(event, taken, base["path"][0]) for event, taken in zip(events, path.states, strict=True)]


class Torn:
    """A cell of `twin` as `CondensedCell` takes it: without displacements along the fibres of plane states."""

    def __init__(self, twin: SolvedAnew, loads: int) -> None:
        own = np.array(IN_PLANE) if loads == 3 else np.arange(loads)
        d = 2 if loads == 3 else 3
        dofs = (3 * np.arange(twin.n)[:, None] + np.arange(d)).ravel()
        self.size, self.lengths, self.key, self.n, self.d = twin.size, twin.length, twin.length, twin.n, d
        self.K, self.Q, self.mean = twin.K[dofs][:, dofs], twin.Q[np.ix_(dofs, own)], twin.mean[np.ix_(own, own)]
        self.normal, self.fibre_node = twin.frame[:, 0, :2], twin.fibre
        pairs = [np.column_stack([np.arange(twin.n), twin.joined]), np.column_stack([twin.fibre, twin.matrix])]
        self._number = components_of(twin.n, np.concatenate(pairs))

    def _together(self, bonded: np.ndarray) -> csr_matrix:
        """(n d, free) displacements of all nodes from those of one of each place but the first, which is held."""
        free = np.flatnonzero(self._number)
        entries = np.ones(len(free)), (free, self._number[free] - 1)
        one = csr_matrix(entries, shape=(self.n, int(self._number.max())))
        return kron(one, identity(self.d)).tocsr()


class Teeth(MixedPath):
    """A path whose bonds have the law of a case by `verify`, and break at once or tooth by tooth."""

    def __init__(self, cell: CondensedCell, files: ResultFiles, softens: bool, holds: np.ndarray) -> None:
        super().__init__(cell, self, holds.astype(float))
        self.files, self.softens = files, softens
        own = law_at(files)
        self.levels = np.array(own.levels) if softens else np.array([0.0, 1.0])
        self.has_toughness = own.has_toughness
        self.level = np.where(holds, 0, len(self.levels) - 1)
        self.taken, self.states = 0.0, list[tuple[float, int, int]]()

    def used(self, cell: CondensedCell, state: Any, kept: np.ndarray) -> np.ndarray:
        """(k,) share of what breaks each bond, or its next tooth."""
        law = law_at(self.files, damage=1.0 - kept)
        return np.asarray(law.utilisation(state.force / cell.lengths[:, None]) * (kept > 0.0))

    def point(self, event: Any, state: tuple[float, int, int], like: Any) -> dict[str, Any]:
        """Return a point of a path as result.json has it, with what the bonds had taken, and how many held."""
        taken, bonded, parted = state
        own, strains = event.state, len(like["strain"])
        found = {
            "load_factor": event.load_factor, "strain": own.strain[:strains].tolist(),
            "stress": own.stress[:strains].tolist(), "broke": parted, "bonded": bonded, "stored": own.stored,
            "stored_in_springs": own.in_springs, "dissipated": event.dissipated,
            "dissipated_strain_controlled": event.dissipated_at_rising_load,
        }  # fmt: skip
        found |= {"softened": int(event.broke.sum()) - parted} if self.softens else {}
        found |= {"fracture_energy": taken} if self.has_toughness else {}
        return found | ({"temperature": own.strain[6]} if "temperature" in like else {})

    def _report(self, load_factor: float, state: Any, broke: np.ndarray) -> None:
        super()._report(load_factor, state, broke)
        parted = int((self.level[broke] == len(self.levels) - 2).sum())
        self.states.append((self.taken, int(np.count_nonzero(self.bonded)), parted))

    def _weaken(self, event: Any) -> None:
        which, damage = event.broke, np.append(self.levels, 1.0)
        law = law_at(self.files, which)
        psi = law.mode(event.state.force[which] / self.cell.lengths[which, None])
        before, after = damage[self.level[which]], damage[self.level[which] + 1]
        self.taken += float(law.absorbed(psi, before, after) @ self.cell.lengths[which]) / self.cell.area
        self.level[which] += 1
        self.bonded = 1.0 - self.levels[self.level]
