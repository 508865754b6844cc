"""Propagated scatter beside sampled scatter: a cell of correlated, uncertain phases, run with sampled constants.

    mpirun -n 2 .venv/bin/python scripts/uncertainty_samples.py --samples 2000

Prints for every constant the first-order and the sampled standard deviation, the latter with its sampling error.
"""

import argparse
import copy
import sys
from typing import Any

import numpy as np
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch, run
from feti_homog.studies.uncertain_numbers import read_uncertainty

CASE: dict[str, Any] = {
    "cell": {"geometry": "hexagonal", "fibre_fraction": 0.55, "mesh_size": 0.3, "order": 1},
    "material": {
        "matrix": {"young": {"mean": 3.45, "cv": 0.04}, "poisson": {"mean": 0.35, "std": 0.01}},
        "fibre": {"young": {"mean": 73.0, "std": 2.0}, "poisson": 0.22},
    },
    "uncertainty": {"correlation": [["material.matrix.young", "material.matrix.poisson", 0.3]]},
    "analysis": {"type": "stiffness", "plane": "generalized"},
    "output": {"mesh_error": False, "sensitivities": True},
}


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Compare both standard deviations; samples are divided among the ranks."""
    from mpi4py import MPI

    document = copy.deepcopy(CASE)
    uncertainty = read_uncertainty(document, [])
    names, std = tuple(uncertainty.std), np.array([*uncertainty.std.values()])
    slopes = run(Case.parse(document), comm).sensitivities
    propagated, _ = uncertainty.propagated(slopes.derivatives[:, [slopes.parameters.index(name) for name in names]])
    covariance = np.outer(std, std) * uncertainty.matrix()
    means = [document["material"][name.split(".")[1]][name.split(".")[2]] for name in names]
    samples = np.random.default_rng(1).multivariate_normal(means, covariance, given.samples)
    own = [constants(names, row, MPI.COMM_SELF) for row in samples[comm.rank :: comm.size]]
    found = np.concatenate(comm.allgather(np.array(own)))
    if comm.rank == 0:
        print(f"{'':<16}{'first order':>14}{'samples':>14}{'difference':>12}   +- {(2 * given.samples) ** -0.5:.1%}")
        for name, a, b in zip(slopes.constants, propagated, found.std(axis=0, ddof=1), strict=True):
            if a > 0:
                print(f"{name:<16}{a:>14.5g}{b:>14.5g}{a / b - 1:>12.1%}")


def constants(names: tuple[str, ...], values: Any, comm: Any) -> Any:
    """Return all constants of a cell with given values."""
    document = copy.deepcopy(CASE)
    del document["uncertainty"]
    for name, value in zip(names, values, strict=True):
        _, phase, key = name.split(".")
        document["material"][phase][key] = float(value)
    return run(Case.parse(document), comm).sensitivities.constant_values


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--samples", type=int, default=2000)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
