"""Count how often the intervals of fits to noisy constants of four composites cover the true values.

    .venv/bin/python scripts/fit_coverage.py --trials 200

Each trial adds independent errors of 1 % to the eight constants of a composite, and fits the constants of its phases
from them, as `feti-homog fit` does; the intervals should cover the true values in 95 +- 3 % of the trials.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py.MPI import Intracomm

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support import fitted_composites as composites

from feti_homog import launch
from feti_homog.studies.estimation import estimate


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Print the coverage of every unknown of every composite; trials are divided among the ranks."""
    from mpi4py import MPI

    for name in composites.COMPOSITES:
        own = _Trials(name, given.noise, MPI.COMM_SELF)
        hits, evaluations = np.zeros(len(own.names)), 0
        for trial in range(comm.rank, given.trials, comm.size):
            covered, count = own.run(trial)
            hits, evaluations = hits + covered, evaluations + count
        hits, evaluations = comm.allreduce(hits), comm.allreduce(evaluations)
        if comm.rank == 0:
            shares = ", ".join(f"{key.removeprefix('material.')} {share:.1%}" for key, share in
                               zip(own.names, hits / given.trials, strict=True))  # fmt: skip
            print(
                f"{name}: mean {hits.mean() / given.trials:.1%}, {evaluations / given.trials:.1f} evaluations; {shares}"
            )


class _Trials:
    """Trials of one composite; for carbon fibres without nu_axial, which data with 1 % noise do not determine."""

    def __init__(self, name: str, noise: float, comm: Any) -> None:
        truth, self.noise = composites.truth(name), noise
        kept = np.array([not key.endswith("nu_axial") for key in truth])
        self.names = [key for key, keep in zip(truth, kept, strict=True) if keep]
        self.truth = np.array([truth[key] for key in self.names])
        whole, model = np.array([*truth.values()]), composites.model(name, comm)
        unknown = composites.fit(name, model(whole)[0])["unknown"]
        self.bounds = tuple(np.array([unknown[key][end] for key in self.names]) for end in ("lower", "upper"))

        def computed(x: Any) -> Any:
            at = whole.copy()
            at[kept] = x
            values, derivatives = model(at)
            return values, derivatives[:, kept]

        self.computed = computed
        self.values = computed(self.truth)[0]

    def run(self, trial: int) -> tuple[Any, int]:
        """Return for each unknown whether its interval covers the true value, and the number of evaluations."""
        std = self.noise * np.abs(self.values)
        y = self.values + std * np.random.default_rng(trial).normal(size=len(std))
        known: dict[tuple[float, ...], Any] = {}

        def at(x: Any) -> Any:
            key = tuple(x)
            known[key] = known[key] if key in known else self.computed(x)
            return known[key]

        found = estimate(lambda x: at(x)[0], lambda x: at(x)[1], (y, std), self.truth, self.bounds)
        return np.abs(found.x - self.truth) <= found.half_width, len(known)


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--trials", type=int, default=200)
    options.add_argument("--noise", type=float, default=0.01)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
