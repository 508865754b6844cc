"""Jobs of Python programs one after the other on the same ranks: tests of programs, not of their start, save it.

PETSc starts with the first program, without options.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from support.jobs import PATIENCE, launched

PROGRAM = Path(__file__).with_name("standing_ranks.py")


class StandingJob:
    """Ranks that wait for programs; without mpirun if it is one rank."""

    def __init__(self, ranks: int) -> None:
        self._folder, self._count = Path(tempfile.mkdtemp()), 0
        names = [f"words-{rank}" for rank in range(ranks)]
        for name in ("ended", *names):
            os.mkfifo(self._folder / name)
        self._ended = os.open(self._folder / "ended", os.O_RDONLY | os.O_NONBLOCK)
        self._words = [os.open(self._folder / name, os.O_RDWR) for name in names]  # to write, without waiting
        own = os.open(self._folder / "ended", os.O_WRONLY)  # the launcher's: it ends last
        nothing = {name: subprocess.DEVNULL for name in ("stdin", "stdout", "stderr")}
        self._process = launched(ranks if ranks > 1 else 0, PROGRAM, self._folder, pass_fds=(own,), **nothing)
        os.close(own)

    def run(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a program on all ranks, and return its exit code and what it prints.

        A program that ends the job is an error.
        """
        self._count += 1
        outputs = [self._folder / f"{self._count}.{stream}" for stream in (1, 2)]
        line = json.dumps([*map(str, outputs), *map(str, words)]).encode() + b"\n"
        for end in self._words:
            os.write(end, line)
        codes = b""
        while codes.count(b"\n") < len(self._words):
            if not select.select([self._ended], [], [], PATIENCE)[0]:
                self._process.terminate()
                raise subprocess.TimeoutExpired(list(map(str, words)), PATIENCE)
            received = os.read(self._ended, 4096)
            texts = [path.read_text(encoding="utf-8") for path in outputs if path.exists()]
            assert received, f"{words}: the job has ended: {texts}"
            codes += received
        return subprocess.CompletedProcess(list(map(str, words)), max(map(int, codes.split())), *texts)

    def end(self) -> None:
        for end in (*self._words, self._ended):
            os.close(end)
        self._process.wait(PATIENCE)
        shutil.rmtree(self._folder)


@cache
def standing_job(ranks: int) -> StandingJob:
    """Return the job of so many ranks, which ends with these tests."""
    job = StandingJob(ranks)
    atexit.register(job.end)
    return job
