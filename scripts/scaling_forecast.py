"""Forecast of the cost model of the scaling study, in words."""

from collections.abc import Sequence

from scaling_fit import Shares
from scaling_model import COARSE, LOCAL, MESH, Factor, Machine, Prediction, Rates, predict
from scaling_report import GATHERS, SCALARS, SUMS, Row

RANKS = (1, 2, 16, 64, 1024)
FAR = (64, 1024)
# Share of the time from which on a part is named as what stops the scaling.
LARGE = 0.1
STRONG_DOFS, WEAK_DOFS = 10_000_000, 1_000_000


def forecast(rates: Rates, machine: Machine, way: str | None = None) -> dict[str, list[Prediction]]:
    """Predict strong and weak scaling over RANKS, with a given coarse solver, by default the program's own."""
    words = f", coarse problem by {way}" if way else ""
    return {
        f"strong scaling of {STRONG_DOFS / 1e6:g} million dofs{words}": [
            predict(rates, machine, STRONG_DOFS, ranks, way) for ranks in RANKS
        ],
        f"weak scaling of {WEAK_DOFS / 1e6:g} million dofs a rank{words}": [
            predict(rates, machine, WEAK_DOFS * ranks, ranks, way) for ranks in RANKS
        ],
    }


def assumptions(rates: Rates, machine: Machine) -> list[str]:
    """Return the model in words, with its constants."""
    r, others = rates, []
    if r.multigrid:
        others.append(
            f"              by multigrid: set-up {_shares(r.multigrid.setup)}, a solve {_shares(r.multigrid.solve)} "
            f"times n, in {r.multigrid.inner} iterations at any size"
        )
    return [
        "cost model: seconds on p ranks = mesh + subdomains + coarse problem + messages, none behind another; all "
        "constants are of these runs",
        f"  mesh        {1e6 * r.mesh.serial:.1f} + {1e6 * r.mesh.parallel:.1f} / p microseconds a coarse triangle, "
        f"{1e3 * r.triangles:.1f} of them in 1 000 dofs: meshed, torn and dealt out",
        f"  subdomains  assemble {1e6 * r.assemble:.2f}, set-up {1e6 * r.setup:.2f}, an iteration of {r.loads} loads "
        f"{1e6 * r.apply:.3f} microseconds a dof, measured on 1 rank; over p,",
        f"              times {r.imbalance:.2f} for the fullest rank (measured), or more where few subdomains are left "
        f"to each; {1e3 * r.subdomains:.2f} of them in 1 000 dofs",
        f"  coarse      n = {1e3 * r.vectors:.2f} vectors in 1 000 dofs, up to {r.largest_coarse} timed, and m = "
        f"{1e3 * r.kernel:.2f} rigid-body motions, one factor of all ranks each; seconds of factor and solves:",
        f"              {_powers(r.coarse, 'n')}; {_powers(r.natural, 'm')}",
        *others,
        f"              of {STRONG_DOFS / 1e6:g} million dofs n is {r.vectors * STRONG_DOFS / r.largest_coarse:.1f} "
        "times the largest that was timed: the further, the less these powers are worth (`sizes` times larger ones)",
        f"  messages    {1e6 * machine.latency:.2g} microseconds each and {machine.bandwidth / 1e9:.2g} GB/s; "
        f"{GATHERS + SUMS} exchanges an iteration, each of {r.neighbours} messages and {r.surface:.1f} values",
        f"              times the root of the rank's dofs (most that were counted), sums of coarse vectors, "
        f"and {SCALARS} sums of single values, log2 p messages deep",
        f"  iterations  {r.iterations} at any size, the most of all runs",
        "  memory      not in the model: neither what a rank has of coarse factors, nor whether rank 0 can hold the "
        "lines of the cell; every rank has the bandwidth",
        "              that the single one had",
    ]


def _powers(f: Factor, of: str) -> str:
    """Return the seconds of a factor and of solves in words."""
    return f"{_shares(f.factor)} {of}^{f.factor_power:.2f} and {_shares(f.solve)} {of}^{f.solve_power:.2f}"


def _shares(s: Shares) -> str:
    """Return shares in words."""
    return f"({s.serial:.2g} + {s.parallel:.2g} / p)"


def checks(rates: Rates, machine: Machine, rows: Sequence[Row], cores: int) -> list[str]:
    """Return seconds of each timed run and of the model, and the model's relative error."""
    names = ("mesh", "assemble", "set-up", "solve", "total")
    lines = [
        "model, measured seconds, and the model's error",
        f"{'dofs':>10}{'ranks':>6}  {'coarse':9}" + "".join(f"{name:^24}" for name in names),
    ]
    errors: dict[str, list[float]] = {name: [] for name in names}
    for row in sorted(rows, key=lambda row: (row.dofs, row.ranks, row.way)):
        if row.ranks > cores:
            continue
        p = predict(rates, machine, row.dofs, row.ranks, row.way)
        found = {
            "mesh": (p.mesh, row.seconds["mesh"]),
            "assemble": (p.assemble, row.seconds["assemble"]),
            "set-up": (p.setup + p.coarse_factor, row.seconds["set-up"]),
            "solve": (p.apply + p.coarse_solve + p.messages, row.seconds["solve"]),
            "total": (p.total, row.total),
        }
        for name, (model, seconds) in found.items():
            errors[name].append(model / seconds - 1.0)
        cells = "".join(f"{a:9.2f}{b:8.2f}{a / b - 1.0:+7.0%}" for a, b in found.values())
        lines.append(f"{row.dofs:10}{row.ranks:6}  {row.way:9}{cells}")
    largest = ", ".join(f"{name} {max(map(abs, some)):.0%}" for name, some in errors.items())
    return [*lines, f"largest error: {largest}"]


def table(title: str, found: Sequence[Prediction]) -> list[str]:
    """Return predicted seconds and efficiencies: dofs per second and rank / dofs per second of one rank."""
    names = ("mesh", "assemble", "set-up", "apply", "factor", "coarse", "messages", "total", "efficiency", "of solver")
    lines = [
        f"{title}: seconds",
        f"{'ranks':>7}{'dofs':>10}" + "".join(f"{name:>11}" for name in names),
    ]
    for p in found:
        values = (p.mesh, p.assemble, p.setup, p.apply, p.coarse_factor, p.coarse_solve, p.messages, p.total)
        share = p.dofs / p.ranks / found[0].dofs
        efficiencies = (share * found[0].total / p.total, share * found[0].solver / p.solver)
        lines.append(
            f"{p.ranks:7}{p.dofs:10.1e}" + "".join(f"{v:11.2f}" for v in values)
            + "".join(f"{e:11.1%}" for e in efficiencies)
        )  # fmt: skip
    return lines


def verdict(title: str, found: Sequence[Prediction]) -> list[str]:
    """Return the shares of time on many ranks, and the shares that further ranks do not reduce."""
    lines = []
    for p in found:
        if p.ranks in FAR:
            shares = {name: seconds / p.total for name, seconds in sorted(p.parts.items(), key=lambda part: -part[1])}
            lines.append(f"{title}, {p.ranks} ranks: {', '.join(f'{n} {s:.0%}' for n, s in shares.items())}")
            stuck = [name for name, share in shares.items() if name in (MESH, COARSE) and share > LARGE]
            if shares[LOCAL] < 0.5 and stuck:
                lines.append(f"  more ranks do not help: what stops it is the {' and the '.join(stuck)}")
    return lines
