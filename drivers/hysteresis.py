"""Friction under cyclic shear: damping of a composite with debonded fibres, over amplitude and pressure.

    mpirun -n 2 .venv/bin/python drivers/hysteresis.py --out results/hysteresis

Only pressure holds the glass fibres in the epoxy of a random cell, plane strain.  A pressure from all sides comes
first, S11 = S22 = -p, then gamma12 to and fro, each amplitude several times.  The area of the last loop of an amplitude
is the heat of friction per area of the cell.  With the largest stored energy, the loss factor is area / (2 pi stored).
Coulomb's law has no stress scale, so the loops depend only on amplitude / pressure.
"""

import argparse
import sys
from pathlib import Path

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm
from numpy.typing import NDArray

from feti_homog import Case, Result, launch

MATERIAL = {"matrix": {"young": 2790.0, "poisson": 0.33}, "fibre": {"young": 70800.0, "poisson": 0.22}}  # MPa
COLUMNS = ("friction", "pressure", "amplitude", "loop area", "loss factor", "secant modulus", "points")
Loop = NDArray[np.float64]


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the cycles at each pressure; print, write and draw."""
    if given.quick:
        given.fibres, given.refine, given.cycles = 2, 0, 2
        given.pressures, given.amplitudes = [10.0, 20.0], [0.004, 0.008]
    given.amplitudes = sorted(given.amplitudes)
    found = {pressure: solved(given, comm, pressure) for pressure in given.pressures}
    figures.finish(comm, write, given, found)


def solved(given: argparse.Namespace, comm: Intracomm, pressure: float) -> Result:
    """Return the path of all amplitudes at one pressure."""
    cycle = [sign * a for a in given.amplitudes for sign in [1.0, *[-1.0, 1.0] * given.cycles]]
    document = {
        "name": f"{pressure:g} MPa",
        "cell": {
            "geometry": "random",
            "fibres": given.fibres,
            "fibre_fraction": 0.4,
            "min_gap": 0.1,
            "mesh_size": 0.5 * np.sqrt(0.4 / np.pi / given.fibres),
            "refine": given.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": {"friction": given.friction, "debonded": [{"fibre": "all", "angle": 360.0}]},
        "path": {"waypoints": [{"S11": -pressure, "S22": -pressure}, *({"gamma12": gamma} for gamma in cycle)]},
        "output": figures.written(given) | {"stress_unit": "MPa"},
    }
    return figures.computed(comm, Case.parse(document), given.out / f"{pressure:g}_MPa")


def loops(result: Result, amplitudes: list[float], cycles: int) -> list[Loop]:
    """Return (n, 3) gamma12, S12 and stored energy of the last cycle of each amplitude."""
    points = result.points
    own = np.column_stack([points["strain"][:, 2], points["stress"][:, 2], points["stored"]])
    legs = 1 + len(amplitudes) * (1 + 2 * cycles)
    leg = points["load_factor"] * legs
    # The points at which an amplitude ends, and where its last cycle begins, two legs before.
    ends = [1 + (k + 1) * (1 + 2 * cycles) for k in range(len(amplitudes))]
    return [own[(leg > end - 2 - 1e-9) & (leg < end + 1e-9)] for end in ends]


def row(loop: Loop, amplitude: float) -> list[float]:
    """Return the area of a loop, its loss factor and secant modulus."""
    strain, stress, stored = loop.T
    area = ((stress[1:] + stress[:-1]) * np.diff(strain)).sum() / 2
    return [area, area / (2 * np.pi * (stored.max() - stored.min())), np.ptp(stress) / (2 * amplitude)]


def write(given: argparse.Namespace, found: dict[float, Result]) -> list[Path]:
    """Write hysteresis.csv and hysteresis.png."""
    rows = []
    print("pressure MPa  amplitude   loop area MPa  loss factor  secant modulus MPa  points")
    for pressure, result in found.items():
        for amplitude, loop in zip(given.amplitudes, loops(result, given.amplitudes, given.cycles), strict=True):
            area, loss, modulus = row(loop, amplitude)
            rows.append([given.friction, pressure, amplitude, area, loss, modulus, len(loop)])
            print(f"{pressure:>12g}{amplitude:>11g}{area:>16.6f}{loss:>13.4f}{modulus:>20.1f}{len(loop):>8}")
    draw(given, found, np.array(rows))
    return [figures.tabulate(given.out / "hysteresis.csv", COLUMNS, rows), given.out / "hysteresis.png"]


def draw(given: argparse.Namespace, found: dict[float, Result], rows: Loop) -> None:
    """Draw the loops at the middle pressure, areas over amplitudes, loss factors over amplitude / pressure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    shown = given.pressures[len(given.pressures) // 2]
    for loop in reversed(loops(found[shown], given.amplitudes, given.cycles)):
        left.plot(100 * loop[:, 0], loop[:, 1], color=INK[0], linewidth=1.1)
    left.set(xlabel="$\\gamma_{12}$ (%)", ylabel="$\\Sigma_{12}$ (MPa)")
    left.set_title(f"Last loops at {shown:g} MPa", fontsize=10)
    for k, pressure in enumerate(given.pressures):
        _, _, amplitude, area, loss, _, _ = rows[rows[:, 1] == pressure].T
        style = {"color": INK[k % len(INK)], "linewidth": 1.1, "markersize": 4, "label": f"{pressure:g} MPa"}
        middle.plot(100 * amplitude, 1000 * area, "o-", **style)
        right.plot(1000 * amplitude / pressure, loss, "o-", **style)
    middle.set(xlabel="amplitude of $\\gamma_{12}$ (%)", ylabel="area of a loop (kJ/m³)")
    middle.set_title("Heat of friction", fontsize=10)
    right.set(xlabel="amplitude / pressure (1/GPa)", ylabel="loss factor")
    right.set_title("One curve at all pressures", fontsize=10)
    for axes in (left, middle, right):
        axes.grid(color="0.92", linewidth=0.6)
    for axes in (middle, right):
        axes.set(xlim=(0.0, 1.05 * axes.dataLim.x1), ylim=(0.0, 1.05 * axes.dataLim.y1))
    middle.legend(frameon=False, fontsize=8, title="pressure")
    figure.suptitle(f"Glass/epoxy with debonded fibres, friction {given.friction:g}", fontsize=11)
    figure.savefig(given.out / "hysteresis.png")


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "hysteresis", "two fibres, long elements, few amplitudes")
    options.add_argument("--fibres", type=int, default=10)
    options.add_argument("--refine", type=int, default=1)
    options.add_argument("--friction", type=float, default=0.3)
    options.add_argument("--cycles", type=int, default=2, help="of each amplitude")
    options.add_argument("--pressures", type=float, nargs="+", default=[10.0, 20.0, 40.0], help="MPa")
    amplitudes = [0.002, 0.004, 0.006, 0.008, 0.012, 0.016, 0.02]
    options.add_argument("--amplitudes", type=float, nargs="+", default=amplitudes)
    sys.exit(launch(main, options))
