"""PETSc's options of a solver, tried on a system of one unknown before any work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from petsc4py import PETSc

from feti_homog.petsc import c_functions
from feti_homog.petsc.option_table import DIRECT_PREFIXES, MUMPS_PREFIXES, is_in_table, solver_prefix
from feti_homog.petsc.option_values import VIEWERS, in_words

TRIAL_PREFIX = "feti_trial_"
KRYLOV_PREFIXES = ("feti_ksp_", "feti_pc_")
# Options with the prefixes of PETSc's solvers that the program reads itself.
OWN = ("feti_pc_type", "feti_coarse_space", "feti_coarse_threshold")


@dataclass(frozen=True)
class Trial:
    """A solver that options can be tried on.

    Attributes:
        prefix: of its options.
        solve: make it with the options under TRIAL_PREFIX, and solve; raises PETSc.Error.
    """

    prefix: str
    solve: Callable[[], None]

    def examine(self, given: Mapping[str, str]) -> tuple[list[str], set[str]]:
        """Faults of the options (names without dash) that the solver cannot be made with, and those that it read."""
        if not given:
            return [], set()
        complaint, read = self._attempt(given)
        if not complaint:
            return [], read
        together = f"{' '.join(in_words(name, value) for name, value in given.items())}: {complaint}"
        return self._faults_of_one(given) or [together], read

    def _faults_of_one(self, given: Mapping[str, str]) -> list[str]:
        """Faults of the options that fail alone, with those beside them that choose what the solver is."""
        kinds = {name: value for name, value in given.items() if is_in_table(name) and name.endswith("_type")}
        if kinds and self._attempt(kinds)[0]:
            return []
        others = {name: value for name, value in given.items() if name not in kinds}
        complaints = {name: self._attempt(kinds | {name: value})[0] for name, value in others.items()}
        return [f"{in_words(name, given[name])}: {words}" for name, words in complaints.items() if words]

    def _attempt(self, given: Mapping[str, str]) -> tuple[str, set[str]]:
        """What PETSc says against the options, empty if nothing, and the names of those that it read."""
        database = PETSc.Options()
        trial_names = {name: TRIAL_PREFIX + name.removeprefix(self.prefix) for name in given}
        for name, trial_name in trial_names.items():
            database.setValue(trial_name, given[name] or None)
        try:
            self.solve()
            complaint = ""
        except PETSc.Error as error:
            complaint = str(error).splitlines()[-1].split("] ", 1)[-1].replace(TRIAL_PREFIX, self.prefix)
        read = {name for name, trial_name in trial_names.items() if c_functions.option_was_used(trial_name)}
        for trial_name in trial_names.values():
            database.delValue(trial_name)
        return complaint, read


def examine(given: Mapping[str, str]) -> tuple[list[str], set[str]]:
    """Faults of the options (names without dash) with which PETSc's solvers cannot be made, and those that were read.

    Options that print while solving are not tried.
    """
    tried = {name: value for name, value in given.items() if name not in OWN and name not in VIEWERS}
    krylov = {name: value for name, value in tried.items() if name.startswith(KRYLOV_PREFIXES)}
    method = krylov.get("feti_ksp_type", PETSc.KSP.Type.CG)
    if not _has_method(method):
        return [f"{in_words('feti_ksp_type', method)}: PETSc has no such Krylov method"], set(krylov)
    faults, read = Trial("feti_", _solve_by_krylov_method).examine(krylov)
    for prefix in DIRECT_PREFIXES:
        own = {name: value for name, value in tried.items() if solver_prefix(name) == prefix}
        library = PETSc.Mat.SolverType.MUMPS if prefix in MUMPS_PREFIXES else None
        found, read_here = Trial(prefix, partial(_solve_directly, library)).examine(own)
        faults += found
        read |= read_here
    return faults, read


def _has_method(name: str) -> bool:
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    try:
        ksp.setType(name)
    except PETSc.Error:
        return False
    finally:
        ksp.destroy()
    return True


class _Identity:
    """The 1 x 1 matrix and preconditioner that, as those of the dual problem, only Python knows."""

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        x.copy(y)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        x.copy(y)


def _solve_by_krylov_method() -> None:
    A = PETSc.Mat().createPython((1, 1), _Identity(), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    A.setUp()
    with _solver(A) as ksp:
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setOptionsPrefix(f"{TRIAL_PREFIX}projected_")
        ksp.getPC().setPythonContext(_Identity())
        _solve(ksp)


def _solve_directly(library: str | None) -> None:
    A = PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    with _solver(A) as ksp:
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
        if library is not None:
            ksp.getPC().setFactorSolverType(library)
        _solve(ksp)


def _solve(ksp: PETSc.KSP) -> None:
    """Solve for a right-hand side of 1, printing nothing."""
    ksp.setFromOptions()
    ksp.monitorCancel()
    ksp.setUp()
    x, b = ksp.getOperators()[0].createVecs()
    b.set(1.0)
    ksp.solve(b, x)
    x.destroy()
    b.destroy()


@contextmanager
def _solver(A: PETSc.Mat) -> Iterator[PETSc.KSP]:
    """A solver of a 1 x 1 matrix on this rank, freed at the end of the block with its matrix."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(TRIAL_PREFIX)
    ksp.setOperators(A)
    try:
        yield ksp
    finally:
        ksp.destroy()
        A.destroy()
