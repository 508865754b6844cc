"""Parts that the drivers of the paper's Figures 3 to 5 share: options, cases, tables."""

import argparse
import csv
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py.MPI import Intracomm

from feti_homog import Case, Result, run

EQUATION_38 = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}  # GPa
EQUATION_42 = {"matrix": {"young": 100.0, "poisson": 0.4}, "fibre": {"young": 500.0, "poisson": 0.2}}  # GPa
STYLE = {"font.size": 10, "savefig.dpi": 200, "axes.spines.top": False, "axes.spines.right": False}
# Colours of Okabe and Ito, as in the pictures of the program: one a component.
INK = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
ENTRY_INK = dict(zip(("11", "22", "33", "12"), INK, strict=True))  # of the stiffness; the stress S12 has that of C33


def parser(description: str, name: str, mesh_size: float, refine: int, order: int) -> argparse.ArgumentParser:
    """Return the options that they all have; results go to results/`name` by default."""
    options = quick_parser(description, name, "a coarse mesh and few points")
    options.add_argument("--mesh-size", type=float, default=mesh_size, help="coarse element size / cell width")
    options.add_argument("--refine", type=int, default=refine, help="times that every element is cut in four")
    options.add_argument("--order", type=int, default=order, choices=(1, 2), help="of the elements; 2 are curved")
    options.add_argument("--fibre-fraction", type=float, default=0.4)
    return options


def quick_parser(description: str, name: str, quick: str) -> argparse.ArgumentParser:
    """Options: where results go, by default results/`name`, what is written, and --quick, whose help is `quick`."""
    options = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("results") / name, metavar="DIR")
    add_output_options(options)
    options.add_argument("--quick", action="store_true", help=f"{quick}, in place of the options for these")
    return options


def add_output_options(options: argparse.ArgumentParser) -> None:
    """Write the header of a case: everything but its numbers."""
    options.add_argument("--fields", action="store_true", help="write the fields of every case")
    options.add_argument("--pictures", action="store_true", help="draw every case, and write its fields")


def written(options: argparse.Namespace) -> dict[str, Any]:
    """Return the section [output] for these options."""
    return {"stress_unit": "GPa", "fields": options.fields or options.pictures, "pictures": options.pictures}


def solved(
    options: argparse.Namespace,
    comm: Intracomm,
    name: str,
    geometry: str,
    material: Mapping[str, Any],
    keep_fields: bool = False,
    **rest: Any,
) -> Result:
    """Return the result of the case `name`, on every rank, in a separate folder; `rest` are the other sections."""
    cell = {
        "geometry": geometry,
        "fibre_fraction": options.fibre_fraction,
        "mesh_size": 0.15 if options.quick else options.mesh_size,
        "refine": 0 if options.quick else options.refine,
        "order": options.order,
    }
    output = written(options) | rest.pop("output", {})
    case = Case.parse({"name": name, "cell": cell, "material": dict(material), "output": output, **rest})
    return computed(comm, case, options.out / name.replace(" ", "_"), keep_fields)


def computed(comm: Intracomm, case: Case, folder: Path, keep_fields: bool = False) -> Result:
    """Return the result of a case, on every rank, and print on stderr of rank 0 how long it took."""
    start = time.perf_counter()
    result = run(case, comm, out=folder, fields=keep_fields)
    if comm.rank == 0:
        points = f", {len(result.path)} points" if result.path else ""
        print(f"  {folder.name}: {time.perf_counter() - start:.1f} s{points}", file=sys.stderr, flush=True)
    return result


def tabulate(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> Path:
    """Write a table."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows(rows)
    return path


def finish(comm: Intracomm, write: Callable[..., list[Path]], *args: Any) -> None:
    """Write the files of rank 0 and print their names."""
    if comm.rank == 0:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            for path in write(*args):
                print(path)
