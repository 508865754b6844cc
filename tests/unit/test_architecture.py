"""The rules of the house: imports point to floors below, importing starts nothing, modules and functions are short."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "feti_homog"
FOLDERS = ("feti_homog", "drivers", "scripts", "tests")
LONGEST_MODULE, LONGEST_FUNCTION = 300, 60

# From the ground up: each line may import from itself and from the lines above it.  A package that has floors of its
# own is listed by them; its name alone stands for the modules that lie flat in it, and its `__init__`.
FLOORS = (
    ("errors", "typing"),
    ("system",),
    ("system.runtime",),
    ("system.parallel",),
    ("system.petsc",),
    ("schema",),
    ("microstructure.shapes",),
    ("microstructure",),
    ("materials",),
    ("case",),
    ("verify",),
    ("mesh",),
    ("mesh.outline",),
    ("mesh.tiles",),
    ("mesh.readers",),
    ("mesh.fill",),
    ("fem",),
    ("feti.thresholds",),
    ("feti.linalg",),
    ("feti.decomposition",),
    ("feti.operators",),
    ("feti.exact",),
    ("feti.coarse",),
    ("feti",),
    ("interface.loads",),
    ("interface.contact",),
    ("interface.friction",),
    ("interface.debonded_arcs",),
    ("interface.laws",),
    ("interface.path",),
    ("interface",),
    ("homogenization",),
    ("results",),
    ("report.text",),
    ("report.plots",),
    ("report.cards",),
    ("report",),
    ("analysis",),
    ("studies",),
    ("api",),
    ("commands",),
    ("cli",),
    ("__main__",),
)
LEVEL = {floor: level for level, floors in enumerate(FLOORS) for floor in floors}
MODULES = sorted(PACKAGE.rglob("*.py"))


def floor_of(name: str) -> str | None:
    """Return the floor of a module or of a name in one, both without the package's name.

    None for the package itself.
    """
    words = name.split(".")
    return next((floor for n in (3, 2, 1) if (floor := ".".join(words[:n])) in LEVEL), None)


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


@cache
def imported_names(path: Path) -> set[str]:
    """Return the imports of a module from the package, inside functions too, without the package's name."""
    found = set()
    for node in nodes(path, ast.Import, ast.ImportFrom):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            assert node.level == 0, f"{path}: relative import in line {node.lineno}"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        found |= {name.removeprefix("feti_homog.") for name in names if name.startswith("feti_homog.")}
    return found


def test_every_module_has_its_floor():
    assert {name_of(path) for path in MODULES if floor_of(name_of(path)) is None} == {"__init__"}


def test_imports_point_to_floors_below():
    floors = {name_of(path): {floor_of(name) for name in imported_names(path)} - {None} for path in MODULES}
    levels = {name: LEVEL[floor] for name in floors if (floor := floor_of(name)) is not None}
    above = {name: {floor for floor in floors[name] if LEVEL[floor] > level} for name, level in levels.items()}
    assert not {name: sorted(found) for name, found in above.items() if found}


def test_modules_do_not_import_each_other_in_circles():
    """Imports inside functions and for type checking included."""
    names = [name_of(path).removesuffix(".__init__") for path in MODULES]
    used = {name: modules_of(imported_names(path), names) for name, path in zip(names, MODULES, strict=True)}
    graph = csr_array([[other in used[name] - {name} for other in names] for name in names], dtype=bool)
    circle = connected_components(graph, connection="strong")[1]
    assert not [name for name, own in zip(names, circle, strict=True) if np.count_nonzero(circle == own) > 1]


def modules_of(imported: set[str], names: list[str]) -> set[str]:
    """Return the modules that these are, or whose words these are."""
    return {name if name in names else name.rpartition(".")[0] for name in imported}


def test_importing_starts_nothing():
    program = "import sys, feti_homog, feti_homog.case.cases, feti_homog.cli; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"petsc4py", "mpi4py", "gmsh", "h5py", "matplotlib", "scipy"} & set(run.stdout.split())


def test_results_are_verified_without_the_solver(tmp_path):
    program = "import sys, feti_homog.cli as c; assert c.main(['verify', 'nowhere']) == 2; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = set(run.stdout.split())
    assert "feti_homog.verify.certificate" in loaded and "h5py" in loaded
    assert not {"petsc4py", "mpi4py", "gmsh", "matplotlib"} & loaded
    floors = {floor_of(name.removeprefix("feti_homog.")) for name in loaded if name.startswith("feti_homog.")}
    below = "errors typing system.runtime system.parallel system.petsc schema materials case microstructure"
    assert floors <= {*below.split(), "microstructure.shapes", "system", "results", "verify", "api", "commands", "cli"}


def test_a_stiffness_run_loads_no_other_analysis(tmp_path):
    """At most 130 modules, and nothing of pictures, paths, bond laws, arcs, tables, tiles or other preconditioners."""
    document = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
        "material": {phase: {"young": young, "poisson": 0.3} for phase, young in (("matrix", 1.0), ("fibre", 9.0))},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "output": {"pictures": False},
    }
    program = (
        f"import sys, feti_homog as f; f.run(f.Case.parse({document!r}), out={str(tmp_path)!r}); print(*sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = {name.removeprefix("feti_homog.") for name in run.stdout.split() if name.startswith("feti_homog.")}
    others = {f"analysis.{name}" for name in ("angle", "path", "load", "envelope", "tip_records")}
    others |= {"interface.path", "report.plots", "report.page", "homogenization.energy_release"}
    others |= {"interface.contact.floating_bodies", "interface.friction", "interface.laws", "interface.debonded_arcs"}
    others |= {"materials.estimates", "materials.material_derivatives", "verify", "studies", "case.cell_files"}
    others |= {"report.text.path_table", "report.text.point_tables", "results.checkpoints", "results.landmarks"}
    others |= {"mesh.readers", "mesh.fill.shape_mesher", "mesh.outline.elliptic_outline", "mesh.tiles.matrix_faces"}
    others |= {"microstructure.random_fibres", "microstructure.fibre_table", "microstructure.shapes.shapes"}
    others |= {"feti.coarse.adaptive", "feti.exact.exact_inverse", "feti.operators.with_springs"}
    assert "analysis.stiffness" in loaded and not {"matplotlib"} & {*run.stdout.split()}
    assert not {name for name in loaded if any(name == other or name.startswith(f"{other}.") for other in others)}
    assert len(loaded) < 130  # with the package itself


def test_only_a_rank_that_prints_or_draws_loads_what_is_for_readers():
    program = "import sys, feti_homog.analysis.runner; print(*sys.modules)"
    program += "; import feti_homog.studies.case_runs; print('matplotlib' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    *loaded, draws = run.stdout.split()
    assert not [name for name in loaded if name.startswith(("feti_homog.report", "feti_homog.studies"))]
    assert draws == "False"


def sources(*folders: str) -> list[Path]:
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def nodes(path: Path, *kinds: type[ast.AST], words: str = "") -> list[Any]:
    """Return the nodes of these kinds of a file, none if the words are not in it, for parsing takes long."""
    text = path.read_text(encoding="utf-8")
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, kinds)] if re.search(words, text) else []


@cache
def functions() -> list[tuple[str, int, list[Any]]]:
    """Place, number of lines and defaults of each function; a lambda has none of the former."""
    found = []
    for path in sources(*FOLDERS):
        for f in nodes(path, ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda):
            lines = 0 if isinstance(f, ast.Lambda) else f.end_lineno - f.lineno + 1
            found.append((place(path, f), lines, [*f.args.defaults, *f.args.kw_defaults]))
    return found


def place(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT)}:{node.lineno}"


def test_modules_are_short():
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in sources(*FOLDERS)}
    assert not {str(path.relative_to(ROOT)): n for path, n in lengths.items() if n > LONGEST_MODULE}


def test_functions_fit_a_screen():
    assert not {where: lines for where, lines, _ in functions() if lines > LONGEST_FUNCTION}


def test_types_are_known_not_asked_for():
    calls = [(path, node) for path in sources(*FOLDERS) for node in nodes(path, ast.Call, words="hasattr")]
    assert not [place(*at) for at in calls if isinstance(at[1].func, ast.Name) and at[1].func.id == "hasattr"]


def test_no_result_depends_on_the_clock_of_the_day():
    """Clocks that jump are not read: durations are of clocks that only advance, owners of locks of ticks since boot.

    The date of a run is written once, for readers.
    """
    of_the_day = {"time.time", "time.time_ns", "time.localtime", "time.gmtime", "time.strftime", "time.ctime"}
    words = r"time|\.(now|utcnow|today)\b"
    names = [(path, node) for path in sources("feti_homog") for node in nodes(path, ast.Attribute, words=words)]
    found = [place(*at) for at in names if at[1].attr.startswith(("st_mtime", "st_ctime", "st_atime", "getmtime"))]
    found += [
        place(*at) for at in names if ast.unparse(at[1]) in of_the_day or at[1].attr in ("now", "utcnow", "today")
    ]
    lines = (ROOT / "feti_homog/analysis/runner.py").read_text().splitlines()
    (date,) = (number for number, line in enumerate(lines, 1) if line.strip().startswith('"date": '))
    assert set(found) == {f"feti_homog/analysis/runner.py:{date}"}


def test_defaults_are_immutable():
    """No list, dictionary, set or comprehension that all calls of a function would share."""
    mutable = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)
    found = [
        where
        for where, _, defaults in functions()
        for default in defaults
        if isinstance(default, mutable)
        or (isinstance(default, ast.Call) and ast.unparse(default.func) in ("list", "dict", "set"))
    ]
    assert not found


def test_tests_replace_no_constants():
    """Tests vary arguments: monkeypatch leaves names in capitals alone."""
    found = [
        place(path, call)
        for path in sources("tests")
        for call in nodes(path, ast.Call, words=r"\.(setattr|patch|object)\(")
        if isinstance(call.func, ast.Attribute) and call.func.attr in ("setattr", "patch", "object")
        for word in call.args
        if isinstance(word, ast.Constant) and re.fullmatch(r"(.*\.)?_?[A-Z][A-Z0-9_]+", str(word.value))
    ]
    assert not found


def is_known(name: str) -> bool:
    """Return whether a dotted name begins with a module of the package and goes on with a word that it has."""
    place, words = PACKAGE, name.split(".")[1:]
    while words and ((place / words[0]).is_dir() or (place / f"{words[0]}.py").is_file()):
        place = place / words[0] if (place / words[0]).is_dir() else place / f"{words[0]}.py"
        words = words[1:]
    text = (place / "__init__.py" if place.is_dir() else place).read_text(encoding="utf-8")
    return not words or re.search(rf"\b{words[0]}\b", text) is not None


def test_modules_that_texts_name_are_there():
    """Also in strings, where no import fails: programs that tests write, functions that they replace."""
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    named = {(path.name, name) for path in files for name in re.findall(r"\bfeti_homog(?:\.\w+)+", path.read_text())}
    assert not {(path, name) for path, name in named if not is_known(name)}


def test_scripts_that_start_jobs_do_not_start_mpi():
    """mpirun would refuse to start from a program that MPI runs in."""
    code = "import sys; sys.path.insert(0, 'scripts'); import benchmark, benchmark_sweep, measure_cost, scaling; "
    code += "sys.exit('mpi4py.MPI' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
