"""What the cost model of the scaling study says, in words."""

from __future__ import annotations

from collections.abc import Sequence

from scaling_model import COARSE, COARSE_POWER, LOCAL, MESH, TOGETHER, Machine, Prediction, Rates, predict
from scaling_report import COARSE_SUMS, GATHERS, SCALARS, SUMS, SUMS_TOGETHER, Row

from feti_homog.feti.thresholds import DEFAULTS

RANKS = (1, 2, 16, 64, 1024)
FAR = (64, 1024)
# Share of the time from which on a part is named as what stops the scaling.
LARGE = 0.1
STRONG_DOFS, WEAK_DOFS = 10_000_000, 1_000_000


def forecast(rates: Rates, machine: Machine) -> dict[str, list[Prediction]]:
    """Strong and weak scaling over RANKS."""
    return {
        f"strong scaling of {STRONG_DOFS / 1e6:g} million dofs": [
            predict(rates, machine, STRONG_DOFS, ranks) for ranks in RANKS
        ],
        f"weak scaling of {WEAK_DOFS / 1e6:g} million dofs a rank": [
            predict(rates, machine, WEAK_DOFS * ranks, ranks) for ranks in RANKS
        ],
    }


def assumptions(rates: Rates, machine: Machine) -> list[str]:
    """What the model takes for granted."""
    r = rates
    return [
        "cost model: seconds on p ranks = mesh + subdomains + coarse problem + messages, none behind another",
        f"  mesh        {r.mesh:.2g} s a coarse triangle, {1e3 * r.triangles:.1f} of them in 1 000 dofs: meshed, torn "
        "and dealt out by rank 0",
        f"  subdomains  assemble {1e6 * r.assemble:.2f}, set-up {1e6 * r.setup:.2f}, an iteration of {r.loads} loads "
        f"{1e6 * r.apply:.3f} microseconds a dof, measured on 1 rank; over p,",
        f"              times {r.imbalance:.2f} for the fullest rank (measured), or more where few subdomains are left "
        f"to each; {1e3 * r.subdomains:.2f} of them in 1 000 dofs",
        f"  coarse      n = {1e3 * r.coarse:.2f} unknowns in 1 000 dofs, summed and factored by every rank for itself "
        f"in {r.factor:.2g} n^{COARSE_POWER} s,",
        f"              solved once an iteration in {r.solve:.2g} n log2 n s a load, which ranks deal out: powers of "
        f"sparse plane problems, assumed; factors measured, up to n = {r.largest_coarse};",
        f"              from {DEFAULTS.replicated_vectors / r.vectors / 1e6:.0f} million dofs by all ranks together, "
        f"p^{TOGETHER} times faster, assumed",
        f"  messages    {1e6 * machine.latency:g} microseconds each and {machine.bandwidth / 1e9:g} GB/s, assumed; "
        f"{GATHERS + SUMS} exchanges an iteration, each of {r.neighbours} messages and {r.surface:.1f} values",
        f"              times the root of the rank's dofs (most that were counted); {COARSE_SUMS} sums over ranks of "
        f"{r.loads} n values ({SUMS_TOGETHER} where ranks solve together) and {SCALARS} of single ones,",
        f"              log2 p messages deep; once {r.coarse_bytes:.1f} bytes a dof of coarse matrices for every rank",
        f"  iterations  {r.iterations} at any size, the most of all runs",
        "  memory      not in the model: neither whether each rank can hold the coarse factor, nor rank 0 the mesh; "
        "every rank has the bandwidth",
        "              that the single one had",
    ]


def checks(rates: Rates, machine: Machine, rows: Sequence[Row], cores: int) -> list[str]:
    """The model against every run that was timed."""
    lines = [
        f"{'model / measured':26}{'mesh':>9}{'set-up':>9}{'solve':>9}{'total':>9}{'coarse: factor':>16}{'solve':>8}",
        f"{'dofs':>10}{'ranks':>6}",
    ]
    for row in sorted(rows, key=lambda row: (row.dofs, row.ranks)):
        if row.ranks <= cores:
            p = predict(rates, machine, row.dofs, row.ranks)
            pairs = [
                (p.mesh, row.seconds["mesh"]),
                (p.setup + p.coarse_factor, row.seconds["set-up"]),
                (p.apply + p.coarse_solve + p.messages, row.seconds["solve"]),
                (p.total, row.total),
            ]
            ratios = "".join(f"{a / b:9.2f}" for a, b in pairs)
            once = p.coarse_solve / rates.iterations
            factor, solve = p.coarse_factor / row.coarse_factor, once / row.coarse_solve
            lines.append(f"{row.dofs:10}{row.ranks:6}{'':10}{ratios}{factor:16.2f}{solve:8.2f}")
    return lines


def table(title: str, found: Sequence[Prediction]) -> list[str]:
    """Predicted seconds, and efficiencies: dofs per second and rank, of those of one rank."""
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
    """What the time goes to on many ranks, and what of it no further rank takes off."""
    lines = []
    for p in found:
        if p.ranks in FAR:
            shares = {name: seconds / p.total for name, seconds in sorted(p.parts.items(), key=lambda part: -part[1])}
            lines.append(f"{title}, {p.ranks} ranks: {', '.join(f'{n} {s:.0%}' for n, s in shares.items())}")
            stuck = [name for name, share in shares.items() if name in (MESH, COARSE) and share > LARGE]
            if shares[LOCAL] < 0.5 and stuck:
                lines.append(f"  more ranks do not help: what stops it is the {' and the '.join(stuck)}")
    return lines
