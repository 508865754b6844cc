"""Surroundings of a process: limits, settings of the folder, rights, full disks, kills, ranks."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from support.base_case import changed

from hostile.attempts import Attempt, Content, copy_of
from hostile.results import SMALL

# With four pictures.
DRAWN = changed(("mesh_size = 0.05", "mesh_size = 0.3"), ('"stiffness"', '"load"'), end="[load]\nto = {E11 = 0.01}\n")
UNKNOWN = "[unknown]\nmaterial.fibre.young = {start = 150.0, lower = 50.0, upper = 400.0}\n"
UNKNOWN += "[measured]\nE1 = {value = 130.0, std = 1.0}\n"
SCATTERED = "young = 200.0", "young = {mean = 200.0, cv = 0.05}"
BIG = changed(("mesh_size = 0.05", "mesh_size = 0.003"), end="[output]\npictures = false\n")
NOBODY = "setpriv --reuid=65534 --regid=65534 --clear-groups"
RUN, IN_OUT = "feti run c.toml --out out", "feti run ../c.toml --out ."
# Without what mpirun prints after its ranks: blocks between two lines, and errors of its own.
QUIET_MPI = (
    "{{ mpirun --oversubscribe {} 2>&1 1>&3 | sed '/^---/,/^---/d; /PMIX ERROR/d' >&2; exit ${{PIPESTATUS[0]}}; }} 3>&1"
)
# A file system in memory of so many bytes or files; it ends with the shell, which has its own.
DISK = "mkdir out/disk && mount -t tmpfs -o {} none out/disk && "
LIMITS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "little memory": (f"ulimit -v 800000; {RUN}", "memory (ulimit -v) of the process is limited", (1,)),
    "very little memory": (f"ulimit -v 100000; {RUN}", "memory (ulimit -v) of the process is limited", (1,)),
    "little memory of a rank": (
        QUIET_MPI.format(f"-n 2 bash -c '[ $OMPI_COMM_WORLD_RANK = 0 ] || ulimit -v 800000; {RUN}'"),
        "rank 1: the memory (ulimit -v)",
        (1,),
    ),
    "a small stack": (f"ulimit -s 128; {RUN}", "stack (ulimit -s) of the process is limited", (1,)),
    "little time": ("ulimit -St 3; feti run big.toml --out out", "interrupted by SIGXCPU", (152,)),
}
SURROUNDINGS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "a .petscrc": (f"cd out; echo -feti_ksp_rtol abc > .petscrc; echo -help > petscrc; {IN_OUT}", "", (0,)),
    "a matplotlibrc, and a backend that is none": (
        "cd out; printf 'font.size : \\xff' > matplotlibrc; MPLBACKEND=nonexistent "
        + IN_OUT.replace("c.toml", "drawn.toml"),
        "cell.png",
        (0,),
    ),
    "options by a pipe": (
        "mkfifo out/p; PETSC_OPTIONS='-options_file out/p' feti check c.toml",
        "-options_file out/p: expected a file",
        (2,),
    ),
    "options of a file of itself": (
        "echo -options_file out/o > out/o; PETSC_OPTIONS='-options_file out/o' feti check c.toml",
        "without options_file",
        (2,),
    ),
    "options of the environment": (
        "echo -history > out/o; PETSC_OPTIONS='-feti_ksp_rtol 2 -options_file out/o' feti check c.toml",
        "-history: no option",
        (2,),
    ),
    "words of the environment": ("PETSC_OPTIONS=foo feti check c.toml", "PETSC_OPTIONS: foo: expected options", (2,)),
    "options of YAML": ("PETSC_OPTIONS_YAML='a: b' feti check c.toml", "PETSC_OPTIONS_YAML: expected", (2,)),
    "good options of the environment": (
        r"printf '# a\n-feti_ksp_rtol 1e-9 # b\n' > out/o; PETSC_OPTIONS='-options_file out/o' feti check c.toml",
        "the case is valid",
        (0,),
    ),
    "a .petscrc at home": (
        "mkdir out/h; echo -start_in_debugger > out/h/.petscrc; HOME=out/h feti check c.toml",
        "",
        (0,),
    ),
    "a case by a pipe": ("feti check <(cat c.toml)", "the case is valid", (0,)),
    "an endless case by a pipe": ("cat /dev/zero | feti check /dev/stdin", "more than 4 MiB", (2,)),
}
PROGRAM = "import sys\nfrom feti_homog import Case, run\nfrom mpi4py import MPI\ncase = Case.load('c.toml')\n"
PROGRAMS = {
    "no standard output": "sys.stdout = None\nrun(case, quiet=False)\n",
    "a closed standard output": "sys.stdout.close()\nsys.stderr.close()\nrun(case, quiet=False)\n",
    "no MPI": "MPI.Finalize()\ntry:\n    run(case)\nexcept Exception as met:\n    assert str(met) == 'MPI has ended'\n",
    "threads": (
        "from concurrent.futures import ThreadPoolExecutor\nwith ThreadPoolExecutor(3) as pool:\n"
        "    ends = [pool.submit(run, case) for _ in range(3)]\nerrors = {str(end.exception()) for end in ends}\n"
        "assert errors == {'None', 'another thread of this process works with PETSc'}, errors\n"
    ),
}
FULL: dict[str, str] = {
    "check": "feti check c.toml",
    "fibres": "feti fibres out",
    "verify": "feti verify out",
    "export": "feti export out --format abaqus",
}
ON_DISKS = {
    "a full disk, fit": (
        DISK.format("size=40k") + "feti fit fit.toml --out out/disk/r --quiet",
        "No space left",
        (1, 3),
    ),
    "no more files, uncertainty": (
        DISK.format("nr_inodes=4") + "feti uncertainty scatter.toml --out out/disk/r --quiet",
        "No space left",
        (1, 3),
    ),
    "a full disk, run": (DISK.format("size=200k") + "feti run drawn.toml --out out/disk/r", "No space left", (1,)),
    "no more files, run": (DISK.format("nr_inodes=4") + "feti run drawn.toml --out out/disk/r", "No space left", (1,)),
    "read only": (DISK.format("ro") + "feti run c.toml --out out/disk/r", "out/disk", (1, 2)),
    **{
        f"a full disk, {name}": (
            DISK.format("size=400k") + f"cp out/result.* out/disk; head -c 400k /dev/zero > out/disk/x 2>&-; {words}",
            "No space left",
            (1,),
        )
        for name, words in {
            "plot": "feti plot out/disk",
            "report": "feti report out/disk",
            "export": "feti export out/disk --format csv --out out/disk/card.csv",
        }.items()
    },
}
OTHERS = {
    "fields without rights, plot": ("chmod 000 out/result.h5; {} plot out", "Permission denied", (1,)),
    "fields without rights, verify": ("chmod 000 out/result.h5; {} verify out", "Permission denied", (1,)),
    "fields without rights, report": ("chmod 000 out/result.h5; {} report out", "Permission denied", (1,)),
    "results without rights": ("chmod 000 out/result.json; {} export out --format csv", "Permission denied", (1,)),
    "a folder without rights, plot": ("chmod 700 out; {} plot out", "Permission denied", (1,)),
    "a folder without rights, verify": ("chmod 700 out; {} verify out", "Permission denied", (1,)),
    "a folder that may not be written": ("chmod 755 out; {} plot out", "Permission denied", (1,)),
    "a case without rights": ("chmod 000 c.toml; {} check c.toml", "Permission denied", (2,)),
}


def attempts(prepared: Path) -> Iterator[Attempt]:
    """Yield those that need a process of their own; some need root."""
    files: dict[str, Content] = {"c.toml": SMALL, "drawn.toml": DRAWN, "big.toml": BIG}
    of_studies: dict[str, Content] = {"fit.toml": SMALL + UNKNOWN, "scatter.toml": SMALL.replace(*SCATTERED)}
    made = {**files, **of_studies, "out": copy_of(prepared / "card")}
    for kind, table in (("limits", LIMITS), ("surroundings", SURROUNDINGS)):
        for name, (shell, expected, codes) in table.items():
            yield Attempt(kind, name, (), expected, files | {"out/x": ""}, codes, shell)
    for name, words in FULL.items():
        yield Attempt("full outputs", name, (), "standard output cannot be written", made, (1,), f"{words} > /dev/full")
    for name, content in PROGRAMS.items():
        yield Attempt("programs", name, (), "", {**files, "p.py": PROGRAM + content}, (0,), f"{sys.executable} p.py")
    tag = '"$(hostname).1.0"'  # of a process that began with the machine, which none did
    shell = f"touch out/cell.png.{tag}.part; feti plot out --state 0 && [ ! -e out/cell.png.{tag}.part ]"
    yield Attempt("leftovers", "of a dead plot", (), "state_0.png", made, (0,), shell)
    for name, words in {"reports": "report out", "plots": "plot out --state 0"}.items():
        shell = rf'feti {words} & feti {words} && wait $! && [ -z "$(ls out | grep "[.]part\$")" ]'
        yield Attempt("two at once", name, (), "", made, (0,), shell)
    if os.geteuid() == 0:
        others_enter = all(folder.stat().st_mode & 1 for folder in Path(sys.executable).parents)
        for name, (shell, expected, codes) in OTHERS.items() if others_enter else ():
            words = shell.format(f"{NOBODY} feti")
            yield Attempt("other users", name, (), expected, made, codes, f"chmod 755 . ; {words}")
        for name, (shell, expected, codes) in ON_DISKS.items():
            yield Attempt("disks", name, (), expected, made, codes, shell)
