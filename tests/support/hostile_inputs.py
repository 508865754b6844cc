"""Bad inputs of the command line, each with the words that its one line must have; and meshes for some of them."""

from pathlib import Path

from support.base_case import BASE, changed, ended, fraction

RANDOM = 'geometry = "random"\nfibres = 3\nmesh_size = 0.2'
SMALL = ("mesh_size = 0.05", "mesh_size = 0.15")
PATH = ('"stiffness"', '"path"')


def petsc(*lines: str) -> str:
    return ended("[petsc]\n" + "\n".join(lines) + "\n")


def sweep(*lines: str) -> str:
    return ended("[sweep]\n" + "\n".join(lines) + "\n")


def arc(table: str, *edits: tuple[str, str], end: str = "") -> str:
    return changed(SMALL, *edits, end=f"[interface]\ndebonded = [{table}]\n{end}")


def of_mesh(name: str) -> str:
    circular = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05'
    return changed((circular, f'geometry = "mesh"\nfile = "{name}.msh"'))


OPTIONS: dict[str, tuple[str, str]] = {
    "tolerance of letters": ("-feti_ksp_rtol abc", "-feti_ksp_rtol abc: expected a number above 0 and below 1"),
    "no value": ("-feti_ksp_rtol", "-feti_ksp_rtol: expected a number"),
    "negative tolerance": ("-feti_ksp_atol -1", "-feti_ksp_atol -1: expected a number of at least 0"),
    "divergence below 1": ("-feti_ksp_divtol -3", "-feti_ksp_divtol -3: expected a number above 1"),
    "more than an integer": ("-feti_ksp_max_it 99999999999", "-feti_ksp_max_it 99999999999: expected an integer"),
    "no options file": ("-options_file /nonexistent", "-options_file /nonexistent: expected a file"),
    "options file without end": ("-options_file /dev/zero", "-options_file /dev/zero: expected a file"),
    "a debugger": ("-start_in_debugger", "-start_in_debugger: no option of a program that runs in batch"),
    "a waiting debugger": ("-stop_for_debugger", "-stop_for_debugger: no option of a program that runs in batch"),
    "a history": ("-history", "-history: no option of a program that runs in batch"),
    "other code": ("-python x.py", "-python: no option of a program that runs in batch"),
    "other libraries": ("-dll_prepend /tmp", "-dll_prepend: no option of a program that runs in batch"),
    "no folder of a log": ("-log_view :/nonexistent/x", "-log_view :/nonexistent/x: expected"),
    "no folder of a monitor": ("-feti_ksp_monitor ascii:/nonexistent/m", "-feti_ksp_monitor ascii:/nonexistent/m: "),
    "flag with a word": ("-feti_view abc", "-feti_view abc: expected true or false, or no value"),
    "capital letters": ("-FETI_KSP_RTOL abc", "-feti_ksp_rtol abc: expected a number above 0 and below 1"),
    "errors of PETSc": ("-feti_ksp_error_if_not_converged", "-feti_ksp_error_if_not_converged: expected false"),
    "traps": ("-fp_trap", "-fp_trap: expected false"),
    "no folder of the news": ("-info /nonexistent/x", "-info /nonexistent/x: expected a file"),
    "no folder of memory": ("-malloc_view /nonexistent/x", "-malloc_view /nonexistent/x: expected a file"),
    "workspace of a thousand times": (
        "-feti_schur_mat_mumps_icntl_14 2000000000",
        "-feti_schur_mat_mumps_icntl_14 2000000000: expected an integer of at least 0 and at most 10000",
    ),
    "log of letters": ("-log_all abc", "-log_all abc: expected true or false"),
    "dump of letters": ("-malloc_dump abc", "-malloc_dump abc: expected true or false"),
    "switch with a word": ("-malloc_debug maybe", "-malloc_debug maybe: expected true or false"),
}
"""Words after `check CASE.toml`."""

CASES: dict[str, tuple[str, str]] = {
    "no such Krylov method": (petsc('feti_ksp_type = "foo"'), "-feti_ksp_type foo: PETSc has no such Krylov method"),
    "empty Krylov method": (petsc('feti_ksp_type = ""'), "-feti_ksp_type: PETSc has no such Krylov method"),
    "method that needs a transpose": (petsc('feti_ksp_type = "bicg"'), "-feti_ksp_type bicg: "),
    "restart of letters": (
        petsc('feti_ksp_type = "gmres"', 'feti_ksp_gmres_restart = "abc"'),
        "-feti_ksp_gmres_restart abc: ",
    ),
    "no such norm": (petsc('feti_ksp_norm_type = "foo"'), "-feti_ksp_norm_type foo: expected preconditioned, "),
    "side that the method lacks": (petsc('feti_ksp_pc_side = "right"'), "-feti_ksp_pc_side right: "),
    "neither true nor false": (
        petsc('feti_ksp_lag_norm = "maybe"'),
        "-feti_ksp_lag_norm maybe: ",
    ),
    "no such factorization": (petsc('feti_sub_pc_type = "lux"'), "-feti_sub_pc_type lux: expected one of cholesky, lu"),
    "factors that leave nothing": (
        petsc('feti_schur_pc_type = "lu"'),
        "-feti_schur_pc_type lu: expected cholesky, because",
    ),
    "library that leaves nothing": (
        petsc('feti_schur_pc_factor_mat_solver_type = "cholmod"'),
        "-feti_schur_pc_factor_mat_solver_type cholmod: expected mumps",
    ),
    "no such ordering": (petsc("feti_schur_mat_mumps_icntl_7 = 99"), "-feti_schur_mat_mumps_icntl_7 99: expected one"),
    "tolerance of true": (petsc("feti_ksp_rtol = true"), "-feti_ksp_rtol true: expected a number above 0"),
    "denormal modulus": (
        changed(("88.0", "1e-300")),
        "expected a number above 0; numbers other than 0 have magnitudes",
    ),
    "infinite modulus": (changed(("88.0", "inf")), "expected a number above 0; numbers other than 0 have magnitudes"),
    "denormal strain": (
        changed(PATH, end="[path]\nstrain = [1e-300, 0, 0]\n"),
        "numbers other than 0 have magnitudes from 1e-100 to 1e+100",
    ),
    "seed of forty digits": (
        changed(('geometry = "hexagonal"', RANDOM + f"\nseed = {10**40}"), ("\nmesh_size = 0.05", "")),
        "expected an integer at least 0 and at most 1000000000000000",
    ),
    "unknowns of thirty digits": (ended(f"[decomposition]\nmax_dofs = {10**30}\n"), "at most 1000000000"),
    "an integer of 4334 digits": (fraction(f"0x{'f' * 3600}"), "cell.fibre_fraction: expected no integer of more than"),
    "a name of 4334 digits": (f"name = 0x{'f' * 3600}\n{BASE}", "name: expected no integer of more than"),
    "fraction at the limit": (fraction("0.9068998"), "fibre_fraction = 0.9068998: expected less than 0.9068997 for"),
    "elements without number": (changed(("0.05", "1e-4")), "mesh_size = 0.0001: about 4e+08 elements before refine"),
    "fibres without number": (
        changed(('geometry = "hexagonal"', 'geometry = "random"\nfibres = 100000\ninterface_size = 1e-4')),
        "fibres = 100000: about 9.8e+07 elements before refine; expected at most 20000000",
    ),
    "fibres that nearly touch": (fraction("0.90689968"), "narrow gaps, thin coatings or small fibres need about "),
    "fibres of no size": (fraction("1e-99"), "a fibre has a radius of 1.7e-50; expected at least 1e-06 of the width"),
    "tables without end": ("a." * 2000 + "b = 1\n", "nested more than 50 deep"),
    "arc of no node": (
        arc("{fibre = 1, angle = 0.05}"),
        "[interface] debonded[0]: no node of fibre 1 is within the arc of 0.05 degrees",
    ),
    "opening of no node": (
        arc('{fibre = "all"}', ('"stiffness"', '"angle"'), end="[angle]\nvalues = [0, 0.05, 90]\n"),
        "[interface] debonded[0]: no node of any fibre is within the arc of 0.05 degrees",
    ),
    "step without end": (
        sweep('"cell.fibre_fraction" = {from = 0.1, to = 0.5, step = 1e-12}'),
        "[sweep] cell.fibre_fraction = ",
    ),
    "option of the second case": (
        sweep('"petsc.feti_ksp_type" = ["cg", "foo"]').replace("0.05", "0.2"),
        "case-0002: -feti_ksp_type foo: PETSc has no such Krylov method",
    ),
    "UTF-16": (BASE, "not UTF-8 text (line 1)"),
    "a NUL": (changed(("0.05", "0.05\0")), "not TOML"),
    "a folder": ("", "cannot be read: Is a directory"),
    "a mesh of two triangles": (
        of_mesh("two"),
        "two.msh: no node between the corners of the left, right, lower, upper",
    ),
    "a mesh of 1e200": (of_mesh("huge"), "huge.msh: the cell is 1e+200 x 1e+200: expected lengths"),
    "a mesh of 1e-200": (of_mesh("tiny"), "tiny.msh: the cell is 1e-200 x 1e-200: expected lengths"),
}
"""Contents of a case file for `check`."""

MESHES = {"two": (1, 1.0), "huge": (4, 1e200), "tiny": (4, 1e-200), "plain": (4, 1.0)}


def write_grid(path: Path, count: int, size: float) -> None:
    """Write a square of count x count squares of two triangles, the first of which are fibre."""
    n = count + 1
    nodes = [f"{j * n + i + 1} {size * i / count!r} {size * j / count!r} 0" for j in range(n) for i in range(n)]
    corners = [j * n + i + 1 for j in range(count) for i in range(count)]
    triangles = [t for a in corners for t in ((a, a + 1, a + n + 1), (a, a + n + 1, a + n))]
    elements = [f"{k} 2 2 {1 + (k == 1)} {1 + (k == 1)} {a} {b} {c}" for k, (a, b, c) in enumerate(triangles, 1)]
    sections = {
        "MeshFormat": ["2.2 0 8"],
        "PhysicalNames": ["2", '2 1 "matrix"', '2 2 "fibre"'],
        "Nodes": [str(len(nodes)), *nodes],
        "Elements": [str(len(elements)), *elements],
    }
    path.write_text("".join(f"${name}\n{chr(10).join(lines)}\n$End{name}\n" for name, lines in sections.items()))
