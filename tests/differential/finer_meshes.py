"""Estimated mesh errors against the change from a mesh to one that is refined once more."""

from typing import Any

import numpy as np
from support.other_formats import written
from support.pixel_images import quadrilaterals, random_image
from unit.mesh.faulty_meshes import MshFile

from differential.comparison import DIFFERENT
from differential.random_phases import Document
from differential.setting import Compared, Setting
from differential.transforms import sections
from feti_homog import Case, run
from feti_homog.system.parallel.mpi_errors import on_root

# Largest change / largest estimate that holds: coarse arcs in contact have 18, an ellipse on chords 45 and more.
MOST = 25.0
# Strengths that nothing reaches, and what goes with them: toughnesses by the square.
STRONG = {"strength": 1e3, "toughness": 1e6, "tractions": 1e3, "openings": 1e3}
PIXELS, FORMATS = (5, 10), (".msh", ".inp", ".vtk", ".vtu", ".mesh")
NUMBERS = {"matrix": 0, "fibre": 1}  # of Medit's references, which have no names
SIZES, ACCURACIES = {"mesh_size", "interface_size", "refine"}, (0.02, 0.1)
ROUNDING = 1e-10


def finer_mesh(setting: Setting) -> Compared:
    """Halve all elements: the stiffness, or the energy at the end of a load or path, changes by its error.  Collective.

    Bonds of paths hold, for other bonds would break on the other mesh.
    """
    coarse, document = setting.base, setting.drawn.document
    if setting.drawn.analysis == "path":
        document = _strong(document)
        coarse = setting.solved(document, out=setting.work / "coarse")  # states that are kept have estimates
    cell = document["cell"]
    fine = setting.solved(document | {"cell": cell | {"refine": cell.get("refine", 0) + 1}})
    if fine["cell"]["elements"] <= coarse["cell"]["elements"]:
        return Compared(DIFFERENT, "number of elements")
    if setting.drawn.analysis == "stiffness":
        change = np.subtract(fine["effective_stiffness"], coarse["effective_stiffness"])
        return _ratio(change, coarse["mesh_error"]["effective_stiffness"], "effective_stiffness")
    a, b = (each["load"] if "load" in each else each["path"][-1] for each in (coarse, fine))
    return _ratio(b["stored"] - a["stored"], a["mesh_error"] * a["stored"], f"{setting.drawn.analysis}.stored")


def accuracy(setting: Setting) -> Compared:
    """Let an accuracy choose the mesh: no constant is beyond its bounds, and results agree within their errors.

    Collective.
    """
    document = setting.drawn.document
    cell = {key: value for key, value in document["cell"].items() if key not in SIZES}
    asked = float(10 ** setting.rng.uniform(*np.log10(ACCURACIES)))
    other = setting.solved(document | {"cell": cell | {"accuracy": asked}})
    if other["faults"]:
        return Compared(DIFFERENT, "; ".join(other["faults"]))
    if setting.drawn.analysis == "stiffness":
        errors = [np.array(each["mesh_error"]["effective_stiffness"]) for each in (setting.base, other)]
        change = np.subtract(other["effective_stiffness"], setting.base["effective_stiffness"])
        return _ratio(change, sum(errors), "effective_stiffness")
    if setting.drawn.analysis == "load":
        a, b = setting.base["load"], other["load"]
        return _ratio(b["stored"] - a["stored"], sum(x["mesh_error"] * x["stored"] for x in (a, b)), "load.stored")
    return Compared(0.0, "no constant is beyond its bounds")


def _strong(document: Document) -> Document:
    """Return a case whose bonds hold."""
    strong = []
    for section in sections(document):
        factors = {key: STRONG[end] for key in section if (end := key.rpartition("_")[2]) in STRONG}
        strong.append(section | {key: (factor * np.array(section[key])).tolist() for key, factor in factors.items()})
    return document | ({"interface": strong} if strong else {})


def _ratio(change: Any, estimate: Any, name: str) -> Compared:
    size = float(np.abs(change).max())
    ratio = size / float(np.max(estimate)) if size else 0.0
    return Compared(ratio if ratio > MOST else 0.0, f"{name}: {ratio:.2f} of the estimate")


def quadrilateral_mesh(setting: Setting) -> Compared:
    """Solve a random image in quadrilaterals: it is stiffer than in four triangles each, by about its error.

    Four triangles around a middle node have all displacements of two.  Nothing is of the case.  Collective.
    """
    rng, comm = setting.rng, setting.comm
    image = random_image(int(rng.integers(*PIXELS)), int(rng.integers(1000)), rng.uniform(0.2, 0.5))
    plane, suffix = str(rng.choice(["strain", "stress"])), str(rng.choice(FORMATS))
    material = {"matrix": {"young": 1.0, "poisson": 0.35}, "fibre": {"young": 10 ** rng.uniform(-1, 2), "poisson": 0.2}}
    results = []
    for name, mesh in (("two", quadrilaterals(image)), ("four", _in_four(quadrilaterals(image)))):
        path = setting.work / f"{name}{suffix}"
        on_root(comm, written, mesh, path)
        numbers = {"phases": NUMBERS} if suffix == ".mesh" else {}
        document = {"cell": {"geometry": "mesh", "file": str(path)} | numbers, "material": material,
                    "analysis": {"type": "stiffness", "plane": plane}}  # fmt: skip
        results.append(run(Case.parse(document), comm))
    two, four = (np.asarray(result.effective_stiffness) for result in results)
    if np.linalg.eigvalsh(two - four)[0] < -ROUNDING * np.abs(two).max():
        return Compared(DIFFERENT, f"the stiffness of a {suffix} is below its least one")
    return _ratio(two - four, results[0].mesh_error.effective_stiffness, "effective_stiffness")


def _in_four(mesh: MshFile) -> MshFile:
    """Cut each quadrilateral in four triangles around a middle node."""
    nodes, elements = dict(mesh.nodes), {}
    for _, phase, entity, corners in mesh.elements.values():
        middle = max(nodes) + 1
        nodes[middle] = tuple(np.mean([mesh.nodes[tag] for tag in corners], axis=0).tolist())
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            elements[len(elements) + 1] = (2, phase, entity, (a, b, middle))
    return MshFile(nodes, elements, mesh.names)
