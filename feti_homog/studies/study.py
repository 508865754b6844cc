"""A study: cases that one file describes, a folder with their results, and the document that follows.

DIR/NAME.json                 digest of the study from the start, its answer at the end
DIR/EVALUATION                as of a sweep: a folder for each case

Finished cases are kept, so that the same command resumes.
"""

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from feti_homog.case import toml_files
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.results import atomic, output_folder, result_json
from feti_homog.studies import case_folders, case_runs
from feti_homog.studies.sweep_cases import Sweep
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import input_files, standard_streams
from feti_homog.typing import Intracomm
from feti_homog.version import __version__

SILENT = {"fields": False, "pictures": False, "report": False}


@dataclass(frozen=True)
class Evaluator:
    """Runs a study's cases in folders below its own, in groups of `ranks_per_case` ranks at once."""

    directory: Path
    comm: Intracomm
    ranks_per_case: int
    retry: bool
    quiet: bool

    def results(self, name: str, sweep: Sweep) -> list[dict[str, Any]]:
        """Run the cases of a sweep in folder `name` and return their results on rank 0, none elsewhere.  Collective.

        Raises:
            ConvergenceError: cases failed.
        """
        folder = self.directory / name
        case_runs.run_all(sweep, folder, self.comm, self.ranks_per_case, self.retry, quiet=True)
        states = mpi_errors.on_root_only(
            self.comm, lambda: [case_folders.case_state(folder, entry).document or {} for entry in sweep.entries]
        )
        return states or []


@dataclass(frozen=True)
class Study(ABC):
    """A study of a case document, whose files are relative to `folder`."""

    document: Mapping[str, Any]
    folder: Path

    KIND: ClassVar[str]
    """Name of such a study in messages."""
    FILE: ClassVar[str]
    """Name of its document."""
    ENTRIES: ClassVar[re.Pattern[str]]
    """Names of all its files and folders."""

    @property
    def name(self) -> str:
        return str(self.document.get("name", self.KIND))

    @abstractmethod
    def first_cases(self) -> Sweep:
        """Return the cases that any run of the study computes first."""

    @abstractmethod
    def identity(self, cases: list[str]) -> Any:
        """Return the first cases' identities with all other inputs to the study, in JSON's types."""

    @abstractmethod
    def heading(self) -> str:
        """Return the lines of `check` that come before the first case."""

    @abstractmethod
    def answer(self, evaluator: Evaluator) -> dict[str, Any]:
        """Compute the document of the study, without its digest, on every rank.  Collective."""

    @abstractmethod
    def text(self, document: Mapping[str, Any]) -> str:
        """Return the tables of a finished study."""

    def digest(self) -> str:
        """Short name of the study: equal for equal cases and inputs."""
        cases = [entry.identity for entry in self.first_cases().entries]
        return toml_files.short_digest(json.dumps(self.identity(cases)).encode())

    def describe(self, comm: Intracomm) -> str:
        """Describe the study and its first case; empty except on rank 0.  Collective.

        Raises:
            CaseError, MeshError: the cell of the first case is faulty.
        """
        heading = mpi_errors.on_root(comm, self.heading)
        return case_runs.describe_first(mpi_errors.on_root(comm, self.first_cases), heading, comm)

    def run(
        self, directory: Path, comm: Intracomm, ranks_per_case: int | None, retry: bool, quiet: bool
    ) -> dict[str, Any]:
        """Run the study, or resume it, and return its document on every rank.  Collective.  Arguments as `run_all`.

        Raises:
            CaseError: the folder has another study or files of others, another run writes there, or a result lacks a
                value that the study asks for.
            ConvergenceError: a case failed, or the study has no sound answer; then its files are written.
        """
        size = case_runs.group_size(comm, ranks_per_case)
        mpi_errors.on_root(comm, output_folder.usable, directory)
        head = {"version": __version__, "digest": mpi_errors.on_root(comm, self.digest)}
        path = directory / self.FILE

        def begin() -> None:  # the document has the study's digest from the start
            if is_new := not path.exists():
                with atomic.write_errors(directory):
                    case_folders.refuse_files_of_others(directory, self.ENTRIES, self.KIND)
            else:
                try:
                    stored = result_json.loads(input_files.read(path).decode("utf-8"))
                except (OSError, ValueError) as error:
                    raise CaseError(f"{path} is no readable {self.KIND}: {error}; move it away") from error
                if stored.get("digest") != head["digest"]:
                    raise CaseError(f"--out {directory} holds another {self.KIND}; choose another folder")
            atomic.remove_unfinished(directory, self.ENTRIES)
            if is_new:
                atomic.replace_text(path, result_json.dumps({**head, "status": "running"}))

        with output_folder.held(
            directory, comm, lambda line: standard_streams.complain(line) if comm.rank == 0 else None
        ):
            mpi_errors.on_root(comm, begin)
            document = head | self.answer(Evaluator(directory, comm, size, retry, quiet))
            mpi_errors.on_root_only(comm, atomic.replace_text, path, result_json.dumps(document))
        if comm.rank == 0 and not quiet:
            standard_streams.say(self.text(document))
        if document.get("faults"):
            raise ConvergenceError(*document["faults"])
        return document
