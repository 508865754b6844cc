"""One hostile input: its files, the command that meets it, and how that must end."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

Content = str | bytes | Callable[[Path], object]
LIMIT_S = 60  # of the processor, of each attempt: what takes longer does not end
PATIENCE_S = 10 * LIMIT_S  # of the clock, on a busy machine too: what takes longer waits for ever
MOST_LINES = 21
MOST_S, MOST_MIB = 10.0, 2048  # of the processor and of memory, in a job that tries one command after the other
# How lines on standard error begin; mpirun's own are left out before.
BEGINNINGS = ("error: ", "warning: ", "interrupted by ")


class Outcome(NamedTuple):
    """The faults of an attempt, its processor time in seconds, and its memory in MiB."""

    faults: list[str]
    seconds: float = 0.0
    mib: int = 0


@dataclass(frozen=True)
class Attempt:
    """A command line that meets a hostile input.

    Attributes:
        kind, name: of the input.
        words: of the command; "@" stands for the folder of its files, in which it may only write to "out".
        expected: words that its output must have.
        files: by name, their content or a function that makes them.
        codes: with which it may end.
        shell: instead of words, what bash runs, "feti" being the command line.
    """

    kind: str
    name: str
    words: tuple[str, ...] = ()
    expected: str = ""
    files: Mapping[str, Content] = field(default_factory=dict)
    codes: tuple[int, ...] = (2,)
    shell: str = ""

    def make(self, folder: Path) -> None:
        """Make the files in a new folder."""
        folder.mkdir()
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if callable(content):
                content(path)
            else:
                path.write_bytes(content if isinstance(content, bytes) else content.encode())

    def command(self, folder: Path) -> list[str]:
        return [word.replace("@", str(folder)) for word in self.words]

    def faults(
        self, code: int | None, output: str, errors: str, written: set[Path], seconds: float = 0.0, mib: int = 0
    ) -> list[str]:
        """List what is wrong with its end; code None is that of an attempt that was not done in time."""
        lines = [line for line in errors.splitlines() if line]
        checks = {
            f"code {code} instead of {' or '.join(map(str, self.codes))}": code not in self.codes,
            f"no word of {self.expected!r}": self.expected not in output + errors,
            f"{len(lines)} lines": len(lines) > MOST_LINES,
            "no line": code in (1, 2) and not lines,
            "a traceback": "Traceback" in errors,
            "a line that is no error": any(not line.startswith(BEGINNINGS) for line in lines),
            "characters that a terminal obeys": any(not line.isprintable() for line in (output + errors).split("\n")),
            f"{seconds:.1f} s, {mib} MiB": seconds > MOST_S or mib > MOST_MIB,
            f"writes {sorted(map(str, written))[:3]}": bool(written),
        }
        return [words for words, holds in checks.items() if holds]


def entries(folder: Path) -> set[Path]:
    """Return what is in a folder, but for what is in its `out`."""
    return {path for path in folder.rglob("*") if path.relative_to(folder).parts[0] != "out"}


def copy_of(source: Path, **changes: Content) -> Callable[[Path], object]:
    """Make a copy of a folder with some of its files changed: by their content, or by a function of their path.

    Files are named with "_" for ".".
    """

    def make(path: Path) -> None:
        shutil.copytree(source, path)
        for name, content in changes.items():
            changed = path / name.replace("_", ".")
            if callable(content):
                content(changed)
            else:
                changed.unlink(missing_ok=True)
                changed.write_bytes(content if isinstance(content, bytes) else content.encode())

    return make
