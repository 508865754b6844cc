"""The command line with hooks: at a named call a rank fails, is killed or waits, and the test hears of it.

Tests never guess when something happens.  A rank that has come somewhere reports it through a FIFO; what ends is waited
for, to the last rank: the FIFO ends when no process has it open any more.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

NO_MEMORY = "raise MemoryError('none left')"
KILL = "os.kill(os.getpid(), signal.SIGKILL)"
WAIT = "wait()"


@dataclass(frozen=True)
class Hook:
    """Code that a rank runs when a function is called.

    Attributes:
        place: "module:name" under which the function is called.
        code: Python, which may use `args` of the call, `comm`, `report(text)` to the test, `wait()` for its `release`
            or for a signal, and `outlive(rank)`.
        rank: all with None.
        call: at the which of its calls on this rank, from 1.
        when: which calls are counted, by `args`.
        after: when it returns, instead of before it begins.
    """

    place: str
    code: str
    rank: int | None = 0
    call: int = 1
    when: str = "True"
    after: bool = False


class HookedJob:
    """`python -m feti_homog words...` with hooks, on so many ranks (0: without mpirun), in the background.

    `options` are those of Popen.  When the block ends, whatever is left of the job is killed.
    """

    def __init__(self, ranks: int, hooks: Sequence[Hook], *words: str | Path, **options: Any) -> None:
        from support.jobs import launched

        self._folder = Path(tempfile.mkdtemp())
        for name in ("reported", "release", *(f"rank-{rank}" for rank in range(max(ranks, 1)))):
            os.mkfifo(self._folder / name)
        lives = [path for path in self._folder.iterdir() if path.name != "release"]
        self._ends = {path.name: os.open(path, os.O_RDONLY | os.O_NONBLOCK) for path in lives}
        self._received = b""
        program = [__file__, self._folder, json.dumps([asdict(hook) for hook in hooks]), *words]
        own = os.open(self._folder / "reported", os.O_WRONLY)  # the launcher's: it ends last
        texts = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        self.process = launched(ranks, *program, pass_fds=(own,), **texts | options)
        os.close(own)

    def reported(self) -> str:
        """Return the next report: the number of its rank and the text, "here" of a rank that waits."""
        while b"\n" not in self._received:
            if not self._read():
                raise AssertionError(f"the job has ended before: {self.process.communicate()}")
        line, _, self._received = self._received.partition(b"\n")
        return line.decode()

    def release(self) -> None:
        """Let the rank that waits go on."""
        os.close(os.open(self._folder / "release", os.O_WRONLY))

    def ended(self) -> subprocess.CompletedProcess[str]:
        """Return the job when it has ended by itself, with all its processes."""
        from support.jobs import PATIENCE

        output, errors = self.process.communicate(timeout=PATIENCE)
        while self._read():
            pass
        return subprocess.CompletedProcess(self.process.args, self.process.returncode, output, errors)

    def killed(self) -> None:
        """Kill -9 of all its processes, and wait for their end."""
        for pid in [*descendants(self.process.pid), self.process.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self.process.communicate()
        while self._read():
            pass

    def _read(self) -> bool:
        """Wait for a report; False when no process is left that could send one."""
        from support.jobs import PATIENCE

        if not select.select([self._ends["reported"]], [], [], PATIENCE)[0]:
            raise TimeoutError("processes of the job neither report anything nor end")
        received = os.read(self._ends["reported"], 4096)
        self._received += received
        return bool(received)

    def __enter__(self) -> HookedJob:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.returncode is None:
            self.killed()
        for end in self._ends.values():
            os.close(end)
        shutil.rmtree(self._folder)


def hooked(ranks: int, hooks: Sequence[Hook], *words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run such a job to its end and to that of all its processes."""
    with HookedJob(ranks, hooks, *words) as job:
        return job.ended()


def descendants(pid: int) -> list[int]:
    """Return the processes that a process has started, and theirs."""
    children = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            child = int(stat.parent.name)
            children += [child, *descendants(child)]
    return children


def _install(hook: Hook, comm: Any, names: dict[str, Any]) -> None:
    """Put a hook before or behind the function at its place, if it is one of this rank's."""
    if hook.rank not in (None, comm.rank):
        return
    module, _, path = hook.place.partition(":")
    *owners, name = path.split(".")
    owner = import_module(module)
    for each in owners:
        owner = getattr(owner, each)
    function: Callable[..., Any] = getattr(owner, name)
    calls = 0

    def with_hook(*args: Any, **kwargs: Any) -> Any:
        nonlocal calls
        found = names | {"args": args}
        counts = bool(eval(hook.when, found))
        calls += counts
        reached = counts and calls == hook.call
        result = function(*args, **kwargs) if hook.after else None
        if reached:
            exec(hook.code, found)
        return result if hook.after else function(*args, **kwargs)

    setattr(owner, name, with_hook)


def main(folder: str, hooks: str, *words: str) -> int:
    """Return the exit code of the command line with these words."""
    from feti_homog import api, cli

    def command(words: Sequence[str], comm: Any) -> int:
        reported = os.open(f"{folder}/reported", os.O_WRONLY)
        os.open(f"{folder}/rank-{comm.rank}", os.O_WRONLY)  # to the end of this process

        def report(text: str) -> None:
            os.write(reported, f"{comm.rank} {text}\n".encode())

        def wait() -> None:
            report("here")
            os.close(os.open(f"{folder}/release", os.O_RDONLY))

        def outlive(rank: int) -> None:
            Path(f"{folder}/rank-{rank}").read_bytes()

        names = {"os": os, "signal": signal, "comm": comm, "report": report, "wait": wait, "outlive": outlive}
        for each in json.loads(hooks):
            _install(Hook(**each), comm, names)
        return cli._command(words, comm)

    return api.start(command, words)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
