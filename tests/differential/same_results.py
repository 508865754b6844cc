"""Equal cases in other words, or solved in other ways: their results are alike."""

import contextlib
from typing import Any
from unittest import mock

import numpy as np
from support import dimensions
from support.dimensions import Units

from differential import comparison, transforms
from differential.random_cases import Drawn
from differential.setting import Compared, Setting
from feti_homog.errors import FetiHomogError
from feti_homog.results.checkpoints import Checkpoint
from feti_homog.system.parallel.mpi_errors import on_root

# Units that a case's own are multiplied by.
STRESS_UNITS = (1e-20, 1e20)
LENGTH_UNITS = (1e-7, 1e7)  # widths are between 0.1 and 10 before, and a case file's between 1e-9 and 1e9
MOST_SUBDOMAINS = 12


class Killed(FetiHomogError):
    """The end of a run at an event, on all ranks."""


def ranks(setting: Setting) -> Compared:
    """Solve the case on the ranks of `comm`.  Collective."""
    return setting.compared(setting.solved(setting.drawn.document))


def unit_of_stress(setting: Setting) -> Compared:
    """All stresses in another unit.  Collective."""
    unit = _unit(setting, STRESS_UNITS)
    other = setting.solved(transforms.in_units(setting.drawn.document, Units(stress=unit)))
    return setting.compared(dimensions.in_units(other, Units(stress=1 / unit)))


def unit_of_length(setting: Setting) -> Compared:
    """All lengths in another unit.  Collective."""
    unit = _unit(setting, LENGTH_UNITS)
    drawn = setting.drawn
    document = transforms.in_units(drawn.document, Units(length=unit))
    if "file" in document["cell"]:
        on_root(setting.comm, transforms.scale_mesh, drawn.folder, setting.work, unit)
        drawn = Drawn(drawn.seed, drawn.number, document, setting.work)
    other = Setting(drawn, setting.base, setting.files, setting.comm, setting.rng, setting.work).solved(document)
    return setting.compared(dimensions.in_units(other, Units(length=1 / unit)))


def _unit(setting: Setting, within: tuple[float, float]) -> float:
    return float(10.0 ** setting.rng.uniform(*np.log10(within)))


def order_of_input(setting: Setting) -> Compared:
    """Keys, rows of tables, arcs and sections of interfaces in another order.  Collective."""
    document, places = transforms.reordered(setting.rng, setting.drawn.document)
    return setting.compared(transforms.relabelled(setting.solved(document), places))


def pieces(setting: Setting) -> Compared:
    """Bodies cut into other subdomains, or at the sides of the cell.  Collective."""
    document, rng = dict(setting.drawn.document), setting.rng
    document["cell"] = document["cell"] | {"bodies": str(rng.choice(["torus", "plane"]))}
    document["decomposition"] = {"subdomains": int(rng.integers(2, MOST_SUBDOMAINS + 1))}
    return setting.compared(setting.solved(document), pieces=True)


def influence_columns(setting: Setting) -> Compared:
    """Columns of influence that begin anew after two changed rows.  Collective."""
    own = {"feti_ksp_rtol": setting.drawn.rtol, "feti_pc_type": "influence", "feti_influence_columns": 2}
    return setting.compared(setting.solved(setting.drawn.document | {"petsc": own}))


def resume(setting: Setting) -> Compared:
    """Return a path that ends at a random event and goes on from there. Collective."""
    events = len(setting.base["path"])
    last = int(setting.rng.integers(events))
    write = Checkpoint.write

    def written(checkpoint: Checkpoint, number: int, *arrays: Any, **kind: bool) -> None:
        write(checkpoint, number, *arrays, **kind)
        if number == last:
            raise Killed(f"at event {number}")

    with mock.patch.object(Checkpoint, "write", written), contextlib.suppress(Killed):
        setting.solved(setting.drawn.document, out=setting.work)
    other = setting.solved(setting.drawn.document, out=setting.work, resume=True)
    if other["resumed"] != last + 1:
        return Compared(comparison.DIFFERENT, f"resumed = {other['resumed']}, not {last + 1}")
    return setting.compared(other)
