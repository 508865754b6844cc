"""Run a study: compute the cases that one file describes, and derive one document from their results.

DIR/NAME.json                 digest of the study from the start, its answer at the end
DIR/EVALUATION                sweep folder, with a folder for each case

Finished cases are kept, so that the same command resumes the study.
"""

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from feti_homog import __version__
from feti_homog.case import toml_files
from feti_homog.errors import CaseError, ConvergenceError, FolderError
from feti_homog.results import atomic, output_folder, result_json
from feti_homog.studies import case_folders, case_runs
from feti_homog.studies.sweep_cases import Sweep
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import input_files, standard_streams
from feti_homog.typing import Intracomm

SILENT = {"fields": False, "pictures": False, "report": False}


@dataclass(frozen=True)
class Evaluator:
    """A runner of the cases of a study, in subfolders.  Groups of `ranks_per_case` ranks work concurrently."""

    directory: Path
    comm: Intracomm
    ranks_per_case: int
    retry: bool
    quiet: bool
    warnings: list[str] = field(default_factory=list)  # warnings of the first cases

    def results(self, name: str, sweep: Sweep) -> list[dict[str, Any]]:
        """Run the cases of a sweep in the subfolder `name`.  Collective.

        Returns result.json of all cases on rank 0, [] elsewhere; prints the first warnings.  Raises like `run_all`, but
        FolderError in place of CaseError: the cases are sound.
        """
        folder = self.directory / name
        try:
            case_runs.run_all(sweep, folder, self.comm, self.ranks_per_case, self.retry, quiet=self.quiet or None)
        except CaseError as error:
            raise FolderError(*error.faults) from error
        documents = mpi_errors.on_root_only(
            self.comm, lambda: [case_folders.case_state(folder, entry).document or {} for entry in sweep.entries]
        )
        if not self.warnings:
            lines = dict.fromkeys(line for document in documents or () for line in document.get("warnings", ()))
            self.warnings.extend(self.comm.bcast([*lines]))
            if self.comm.rank == 0 and not self.quiet and lines:
                standard_streams.say("\n".join(f"warning: {line}" for line in lines))
        return documents or []


@dataclass(frozen=True)
class Study(ABC):
    """A study of the cases that a document describes.  File names in the document are relative to `folder`."""

    document: Mapping[str, Any]
    folder: Path

    KIND: ClassVar[str]
    """Name of this kind of study in messages."""
    FILE: ClassVar[str]
    """File name of the document of the study."""
    ENTRIES: ClassVar[re.Pattern[str]]
    """Names of all files and subfolders of the study."""

    @property
    def name(self) -> str:
        return str(self.document.get("name", self.KIND))

    @abstractmethod
    def first_cases(self) -> Sweep:
        """Return the cases that every run of the study computes first."""

    @abstractmethod
    def identity(self, cases: list[str]) -> Any:
        """Return all inputs of the study as JSON values; `cases` has the identities of its first cases."""

    @abstractmethod
    def heading(self) -> str:
        """Return the text that `feti-homog check` prints before the description of the first case."""

    @abstractmethod
    def answer(self, evaluator: Evaluator) -> dict[str, Any]:
        """Compute the document of the study, except for digest and warnings, on every rank.  Collective."""

    @abstractmethod
    def text(self, document: Mapping[str, Any]) -> str:
        """Return the tables to print for the `document` of a finished study."""

    def digest(self) -> str:
        """Return the digest of the study.  Studies with equal cases and inputs have equal digests."""
        cases = [entry.identity for entry in self.first_cases().entries]
        return toml_files.short_digest(json.dumps(self.identity(cases)).encode())

    def describe(self, comm: Intracomm) -> str:
        """Describe study and first case on rank 0; "" elsewhere.  Collective.  Raises CaseError and MeshError."""
        heading = mpi_errors.on_root(comm, self.heading)
        return case_runs.describe_first(mpi_errors.on_root(comm, self.first_cases), heading, comm)

    def run(
        self, directory: Path, comm: Intracomm, ranks_per_case: int | None, retry: bool, quiet: bool
    ) -> dict[str, Any]:
        """Run or resume the study, and return its document on every rank.  Collective.

        Arguments are as for `case_runs.run_all`.

        Raises:
            CaseError: the folder holds another study or foreign files, another run writes to the folder, or a result
                lacks a value that the study needs.
            FolderError: the folder of an evaluation cannot be used.
            ConvergenceError: a case failed; or the study has no sound answer, after its files are written.
            FetiHomogError: a file cannot be written.
        """
        size = case_runs.group_size(comm, ranks_per_case)
        mpi_errors.on_root(comm, output_folder.usable, directory)
        head = {"version": __version__, "digest": mpi_errors.on_root(comm, self.digest)}
        path = directory / self.FILE

        def begin() -> None:  # the document has the digest from the start
            with case_folders.document_lock(directory):
                if not path.exists():
                    with atomic.file_errors("write", directory):
                        case_folders.refuse_files_of_others(directory, self.ENTRIES, self.KIND)
                    atomic.replace_text(path, result_json.dumps({**head, "status": "running"}))
                else:
                    try:
                        stored = result_json.loads(input_files.read(path).decode("utf-8"))
                    except (OSError, ValueError) as error:
                        raise CaseError(f"{path} is no readable {self.KIND}: {error}; move it away") from error
                    if stored.get("digest") != head["digest"]:
                        raise CaseError(f"--out {directory} holds another {self.KIND}; choose another folder")
                atomic.remove_unfinished(directory, self.ENTRIES)

        say = standard_streams.complain if comm.rank == 0 else lambda line: None
        with output_folder.held(directory, comm, say):
            mpi_errors.on_root(comm, begin)
            evaluator = Evaluator(directory, comm, size, retry, quiet)
            document = head | self.answer(evaluator) | {"warnings": evaluator.warnings}
            mpi_errors.on_root_only(comm, atomic.replace_text, path, result_json.dumps(document))
        if comm.rank == 0 and not quiet:
            standard_streams.say(self.text(document))
        if document.get("faults"):
            raise ConvergenceError(*document["faults"])
        return document
