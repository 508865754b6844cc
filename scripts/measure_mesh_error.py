"""Measures the quality of estimated mesh errors: true error / estimate, on one rank.

    .venv/bin/python scripts/measure_mesh_error.py [--only WORDS] [--refine N] [--nested] [--least SHARE]
    .venv/bin/python scripts/measure_mesh_error.py --factors [--only WORDS] [--refine N]

Prints, for each cell, order of elements and each of three refinements, the least and the largest ratio over the
stiffness entries above 1e-3 of the largest entry whose estimate exceeds the error of the exact value; then the share of
all ratios between 0.5 and 2.  Exact values are spectral (tests/reference/references.py) or come from quadratic elements
refined twice more.

`--factors` prints the values of `NESTED`, `LOCKED` and `SAMPLED` of feti_homog/homogenization/mesh_estimate.py: errors
of elements and of arcs by the mesh itself / errors by the mesh refined less, for diagonal entries, in cells cut by
bodies and across materials.  For quadratic elements in phases that lock, which need no coarser mesh, it also prints
(true error - arc error) / element error.
"""

import argparse
import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from reference.references import ARC_OF_120_DEGREES_FINE, AXIAL_SHEAR, BONDED, ELASTIC, VOID

from feti_homog import Case, run
from feti_homog.analysis.context import AnalysisContext
from feti_homog.homogenization.mesh_estimate import energy_errors, factors, is_nested
from feti_homog.homogenization.partition_policy import BY_COST
from feti_homog.homogenization.uniform_parts import locks
from feti_homog.homogenization.unit_cell import tear
from feti_homog.materials.voigt import SPATIAL_STRAINS
from feti_homog.system.runtime.standard_streams import Progress
from feti_homog.typing import Float

SIZES = {1: (0.1, 0.05, 0.025), 2: (0.2, 0.1, 0.05)}
EXACT = {"mesh_size": 0.05, "order": 2, "refine": 2}
PAPER = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}
GLASS = {"matrix": {"young": 3.45, "poisson": 0.35}, "fibre": {"young": 73.0, "poisson": 0.22}}
BORON = {"matrix": {"young": 68.3, "poisson": 0.3}, "fibre": {"young": 379.3, "poisson": 0.1}}
INCOMPRESSIBLE = {0.35: (3.304196, 1.312082, 0.671171), 0.49: (29.16768, 26.55517, 0.624632)}
INCOMPRESSIBLE_ERROR = 5e-6
PARTS = "elements", "arcs", "true"
LOCKS_ABOVE = 0.4  # Poisson's ratio
# Name, case, stiffness if it is known, and its absolute error.
Known = tuple[str, dict[str, Any], Float | None, float]


def lattice(geometry: str, fraction: float = 0.4, **more: Any) -> dict[str, Any]:
    """Return the section of a cell."""
    return {"geometry": geometry, "fibre_fraction": fraction, **more}


def arc(angle: float, centre: float = 0.0, contact: bool = False) -> dict[str, Any]:
    """Return an interface with an arc debonded on every fibre."""
    return {"contact": contact, "debonded": [{"fibre": "all", "centre": centre, "angle": angle}]}


def case(cell: dict[str, Any], phases: Any = PAPER, interface: Any = None, plane: str = "strain") -> dict[str, Any]:
    """Return a case of the stiffness of a cell."""
    found = {"cell": cell, "material": phases, "analysis": {"type": "stiffness", "plane": plane}}
    return found | ({"interface": interface} if interface else {})


def springs(normal: float, tangential: float) -> dict[str, Any]:
    """Return an interface on springs."""
    return {"contact": False, "normal_stiffness": float(normal), "tangential_stiffness": float(tangential)}


def locking(poisson: float, contrast: float) -> dict[str, Any]:
    """Return the phases of a composite whose matrix hardly changes its volume."""
    return {"matrix": {"young": 1.0, "poisson": poisson}, "fibre": {"young": contrast, "poisson": 0.3}}


def orthotropic(C11: float, C12: float, C33: float, C22: float | None = None) -> Float:
    """Return a stiffness (3, 3)."""
    return np.array([[C11, C12, 0.0], [C12, C11 if C22 is None else C22, 0.0], [0.0, 0.0, C33]])


def spectral() -> list[Known]:
    """Return cells of known stiffness."""
    found: list[Known] = []
    for (cell, plane), known in BONDED.items():
        found.append(
            (f"bonded {cell} {plane}", case(lattice(cell), plane=plane), orthotropic(*known.value), known.error)
        )
    for cell, known in VOID.items():
        debonded = case(lattice(cell), interface=arc(360.0))
        found.append((f"debonded {cell}", debonded, orthotropic(*known.value), known.error))
    for (cell, normal, tangential), known in ELASTIC.items():
        document = case(lattice(cell), interface=springs(normal, tangential))
        found.append((f"springs {cell} {normal} {tangential}", document, orthotropic(*known.value), known.error))
    (C11, C22, C12, C33), error = ARC_OF_120_DEGREES_FINE.value[:4], ARC_OF_120_DEGREES_FINE.error
    with_arc = case(lattice("square"), interface=arc(120.0))
    found.append(("arc of 120 degrees", with_arc, orthotropic(C11, C12, C33, C22), error))
    for poisson, values in INCOMPRESSIBLE.items():
        phases = {"matrix": {"young": 1.0, "poisson": poisson}, "fibre": {"young": 1000.0, "poisson": 0.3}}
        found.append((f"nu = {poisson}", case(lattice("square"), phases), orthotropic(*values), INCOMPRESSIBLE_ERROR))
    phases = {name: {"young": young, "poisson": 0.25} for name, young in (("matrix", 2.5), ("fibre", 25.0))}
    for (cell, fraction), known in AXIAL_SHEAR.items():
        axial = np.diag([0, 0, 0, known.value[1], known.value[1], 0])
        document = case(lattice(cell, fraction), phases, plane="generalized")
        found.append((f"axial shear {cell} {fraction}", document, axial, known.error))
    return found


def twins() -> list[Known]:
    """Return cells whose stiffness comes from a finer mesh."""
    cell = {"fibres": 5, "seed": 1, "min_gap": 0.05}
    axes = ((0.3, 0.3, 0.28, 0.15, 20.0), (0.7, 0.75, 0.25, 0.18, 70.0))
    ellipses = [dict(zip(("x", "y", "a", "b", "angle"), own, strict=True)) for own in axes]
    cases = {
        "random glass 0.5": case(lattice("random", 0.5, **cell), GLASS),
        "random glass 0.6": case(lattice("random", 0.6, **cell | {"min_gap": 0.02}), GLASS),
        "random boron 0.5": case(lattice("random", 0.5, **cell), BORON),
        "hexagonal 0.7": case(lattice("hexagonal", 0.7), GLASS),
        "square 0.2": case(lattice("square", 0.2), GLASS),
        "square 0.6": case(lattice("square", 0.6), GLASS),
        "generalized": case(lattice("hexagonal", 0.5), GLASS, plane="generalized"),
        "soft fibres": case(lattice("hexagonal", 0.5), {"matrix": GLASS["fibre"], "fibre": GLASS["matrix"]}),
        "soft coatings": case(lattice("square", coating=0.1), GLASS | {"coating": {"young": 1.0, "poisson": 0.4}}),
        "stiff coatings": case(
            lattice("hexagonal", coating=0.05), GLASS | {"coating": {"young": 100.0, "poisson": 0.2}}
        ),
        "voids": case(lattice("random", 0.4, **cell, voids=0.05), GLASS),
        "ellipses": case({"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": ellipses}, GLASS),
        "springs of glass": case(lattice("hexagonal", 0.5), GLASS, springs(20, 5)),
        "arc of 60 degrees": case(lattice("hexagonal"), interface=arc(60.0)),
        "arc of 180 degrees": case(lattice("square"), GLASS, arc(180.0, centre=45.0)),
        "arc with contact": case(lattice("square"), interface=arc(120.0, contact=True)),
        "nu = 0.45": case(lattice("hexagonal", 0.6), GLASS | {"matrix": {"young": 3.0, "poisson": 0.45}}),
        "locking hexagonal 0.49": case(lattice("hexagonal", 0.6), locking(0.49, 10)),
        "locking random 0.49": case(lattice("random", 0.5, **cell), locking(0.49, 1000)),
        "locking hexagonal 0.4999": case(lattice("hexagonal"), locking(0.4999, 1000)),
        "locking square 0.4999": case(lattice("square", 0.3), locking(0.4999, 100)),
        "locking random 0.4999": case(lattice("random", 0.5, **cell), locking(0.4999, 10)),
    }
    cases |= ellipses_on_springs()
    return [(name, document, None, 0.0) for name, document in cases.items()]


def ellipses_on_springs() -> dict[str, dict[str, Any]]:
    """Return 2:1 ellipses on soft to stiff springs, equal and unequal in both directions, and an arc on springs."""
    pairs = ((1, 1), (10, 10), (10, 2), (2, 10), (100, 25))
    phases = {"matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": 10.0, "poisson": 0.2}}
    fibre = {"x": 0.5, "y": 0.5, "a": 0.36, "b": 0.18, "angle": 20.0}
    cell = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": [fibre]}
    found = {f"ellipse on springs {n} {t}": case(cell, phases, springs(n, t)) for n, t in pairs}
    found["ellipse on springs in space"] = case(cell, phases, springs(10, 2), plane="generalized")
    circle = cell | {"fibre_list": [{"x": 0.5, "y": 0.5, "radius": 0.3}]}
    found["arc of 120 degrees on springs"] = case(circle, phases, springs(10, 4) | arc(120.0))
    return found


def solved(document: dict[str, Any], **mesh: Any) -> tuple[Float, Float]:
    """Return the stiffness on a mesh and its estimated errors."""
    result = run(Case.parse(document | {"cell": document["cell"] | mesh}), MPI.COMM_SELF)
    assert result.effective_stiffness is not None and result.mesh_error is not None
    return result.effective_stiffness, result.mesh_error.effective_stiffness


def parts(document: dict[str, Any], **mesh: Any) -> Float:
    """Return the geometric means (k, k) of the estimated |elements| + |arcs| of the diagonal entries."""
    case = Case.parse(document | {"cell": document["cell"] | mesh})
    cell = tear(case, MPI.COMM_SELF, Progress(MPI.COMM_SELF, quiet=True), policy=BY_COST)
    context, size = AnalysisContext.of(cell, Progress(MPI.COMM_SELF, quiet=True)), dict[str, float]()
    _, _, responses = context.unit_states(context.bonds(None), context.loads.zero_multipliers())
    for problem, own in zip(context.loads.problems, context.loads.by_problem(responses), strict=True):
        errors = energy_errors(problem.cell, own)
        of_loads = np.abs(np.diag(errors.elements)) + np.abs(np.diag(errors.arcs))
        size |= dict(zip(problem.loads, np.sqrt(of_loads), strict=True))
    cell.destroy()
    vector = [size[name] for name in SPATIAL_STRAINS if name in size]
    return np.outer(vector, vector)


def ratios(
    document: dict[str, Any], exact: Float, error: float, order: int, size: float, arguments: argparse.Namespace
) -> Float:
    """Return true error / estimate of the large entries whose estimate is above `error`."""
    mesh = {"mesh_size": size * 2**arguments.refine, "order": order}
    found, estimate = solved(document, **mesh, refine=arguments.refine)
    if arguments.nested:
        estimate = np.abs(solved(document, **mesh, refine=arguments.refine - 1)[0] - found) / (4**order - 1)
    matters = (np.abs(exact) > 1e-3 * np.abs(exact).max()) & (estimate > error)
    if arguments.least:
        matters &= np.abs(found - exact) > arguments.least * parts(document, **mesh, refine=arguments.refine)
    return np.asarray(np.abs(found - exact)[matters] / estimate[matters])


def orders(document: dict[str, Any]) -> list[int]:
    """Return the element orders for a case: linear elements lock beyond 0.49."""
    return [order for order in SIZES if order == 2 or document["material"]["matrix"]["poisson"] <= 0.49]


def both_errors(case: Case, exact: Float | None = None) -> Iterator[tuple[str, Float]]:
    """Yield, for each problem of a case, the label of the factors and (2, k) errors / errors of the coarser mesh.

    The rows are elements and arcs.  An exact stiffness in the plane adds a third row: (true - arc error) / element
    error of the coarser mesh, or of the mesh itself if no coarser mesh is needed.
    """
    cell = tear(case, MPI.COMM_SELF, Progress(MPI.COMM_SELF, quiet=True), policy=BY_COST)
    context = AnalysisContext.of(cell, Progress(MPI.COMM_SELF, quiet=True))
    columns, _, responses = context.unit_states(context.bonds(None), context.loads.zero_multipliers())
    for own in (each.cell for each in context.loads.problems):
        k = len(own.solver.problem.loads)
        under_unit_loads, responses = responses[:k], responses[k:]
        if any(response.debonded for response in under_unit_loads):  # errors at tips are those of the mesh itself
            continue
        is_coarser = is_nested(own, under_unit_loads)
        if is_coarser or exact is not None:
            fewer = own.lattice.halvings - own.nested_lattice.halvings if is_coarser else 0
            known = np.array(factors(own, fewer))[:, None]
            whole, nested = (energy_errors(own, under_unit_loads, nested=less) for less in (False, is_coarser))
            of_nested = np.array([np.diag(nested.elements), np.diag(nested.arcs)]) / known
            found = np.array([np.diag(whole.elements), np.diag(whole.arcs)]) / of_nested
            if exact is not None:
                true = np.diag(columns["stiffness"] - exact) - np.diag(nested.arcs)
                found = np.concatenate([found, true[None] / of_nested[:1]])
            name = "sampled" if own.summary.across else "locked" if locks(own.parts, own.comm) else "nested"
            bubbles = ", bubbles" if any(s.is_mixed for s in own.subdomains) else ""
            yield f"{name}, order {own.lattice.order}, {fewer} less{bubbles}", found
    cell.destroy()


def all_errors(
    document: dict[str, Any], known: Float | None, arguments: argparse.Namespace
) -> Iterator[tuple[str, Float]]:
    """Yield `both_errors` of a cell on all meshes, with an exact stiffness where quadratic elements lock."""
    may_lock = document["material"]["matrix"]["poisson"] > LOCKS_ABOVE
    exact = solved(document, **EXACT)[0] if known is None and may_lock else known
    for order, cut in itertools.product(orders(document), ("auto", "bodies")):
        of_true = exact if order == 2 and cut == "bodies" and may_lock else None
        for size in SIZES[order]:
            mesh = {"mesh_size": min(0.5, size * 2**arguments.refine), "order": order, "refine": arguments.refine}
            own = document | {"cell": document["cell"] | mesh, "decomposition": {"cut": cut}}
            yield from both_errors(Case.parse(own), of_true)


def print_factors(arguments: argparse.Namespace) -> None:
    """Print geometric means over all cells and meshes, and the range of nine tenths of the factors."""
    found: dict[str, list[Float]] = {}
    for name, document, known, _ in (each for each in spectral() + twins() if each[0].startswith(arguments.only)):
        for words, each in all_errors(document, known, arguments):
            found.setdefault(words, []).append(each)
        print(name, file=sys.stderr)
    for words, ratios in sorted(found.items()):
        for row, part in enumerate(PARTS[: max(map(len, ratios))]):
            own = np.concatenate([each[row] for each in ratios if len(each) > row])
            own = own[own > 0]
            low, high = (float(np.percentile(own, share)) for share in (5, 95))
            mean = np.exp(np.log(own).mean())
            print(f"{words:36} {part:8} {mean:.4f} (1/{1 / mean:.1f}), {low:.4f} to {high:.4f}, {len(own)} entries")


def print_ratios(arguments: argparse.Namespace) -> None:
    """Print one line per cell and order, and the shares of all entries."""
    of_all: dict[int, list[float]] = {order: [] for order in SIZES}
    for name, document, known, error in (each for each in spectral() + twins() if each[0].startswith(arguments.only)):
        exact = solved(document, **EXACT)[0] if known is None else known
        for order in orders(document):
            found = [ratios(document, exact, error, order, size, arguments) for size in SIZES[order]]
            of_all[order] += np.concatenate(found).tolist()
            words = ", ".join(f"{own.min():.2f} to {own.max():.2f}" if len(own) else "no entries" for own in found)
            print(f"{name:26} order {order}: {words}", flush=True)
    for order, own in ((order, np.array(each)) for order, each in of_all.items()):
        shares = ", ".join(f"{np.mean(own > x):.1%} above {x:g}" for x in (5.0, 2.0, 0.5, 0.2))
        print(f"order {order}: {len(own)} entries, {shares}")


def main() -> None:
    """Print ratios or factors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="WORDS", help="cells whose names begin so")
    parser.add_argument("--refine", type=int, default=1, help="halvings of coarser meshes; 0 of none")
    parser.add_argument("--nested", action="store_true", help="the solved coarser level in place of recovered stresses")
    parser.add_argument(
        "--least",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="only entries whose true error is above this share of its parts, which may cancel",
    )
    parser.add_argument("--factors", action="store_true", help="of the mesh itself over the mesh refined less")
    arguments = parser.parse_args()
    (print_factors if arguments.factors else print_ratios)(arguments)


if __name__ == "__main__":
    main()
