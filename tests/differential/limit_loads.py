"""Shear of debonded layers and loose blocks below and beyond what a linear programme lets them carry."""

from typing import Any

from support.parted_columns import Columns

from differential.comparison import DIFFERENT
from differential.paths import document_of
from differential.random_loads import STEPS
from differential.setting import Compared, Setting
from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.system.parallel.mpi_errors import on_root

STRESS, LOOSE = -0.01, 0.6
SLIDES_FREELY = "the faces slide freely"


def limit_load(setting: Setting) -> Compared:
    """Random columns, which have nothing of the case, at 0.5 to 2 times their capacity.  Collective.

    Below it they carry the whole shear; beyond it the path ends where they slide freely, with what they carry.
    """
    rng, comm = setting.rng, setting.comm
    columns = Columns.random(rng, bool(rng.random() < LOOSE))
    capacity = columns.largest_shear(STRESS) * float(rng.choice([-1.0, 1.0]))
    method: dict[str, Any] = {"method": "increments", "increments": STEPS} if rng.random() < 0.4 else {}
    plane = str(rng.choice(["strain", "stress", "generalized"]))
    on_root(comm, lambda: columns.mesh().write(setting.work / "cell.msh"))
    found = [(0.0, "")]
    for factor in (rng.uniform(0.5, 0.99), rng.uniform(1.01, 2.0)):
        case = Case.parse(columns.case(STRESS, factor * capacity, method, plane), setting.work)
        out, carried = setting.work / f"{factor:.2f}", min(factor, 1.0)
        try:
            run(case, comm, out=out)
            ended = False
        except ConvergenceError as error:
            if SLIDES_FREELY not in str(error):
                raise
            ended = True
        shear = on_root(comm, document_of, out)["path"][-1]["stress"][-1]
        off = abs(shear - carried * capacity) / abs(capacity) if ended == (factor > 1.0) else DIFFERENT
        found.append((off, f"shear of {factor:.2f} of the capacity"))
    return Compared(*max(found))
