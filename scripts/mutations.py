"""Put deliberate one-line errors into copies of the program, and list the tests that detect each error.

`.venv/bin/python scripts/mutations.py [WORD ...]` tries the errors of tests/mutations.toml whose printed line has one
of the words, or all. It ends with 1 if an error survives, or if tests fail without an error.
"""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "tests" / "mutations.toml"
PYTEST = ("pytest", "-q", "--color=no", "--tb=no", "-rfE", "-p", "no:cacheprovider")
NOTICED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)
# Ranks that wait for each other have noticed the error, too: after this many times as long as the tests take without.
TIMES, LEAST_S, LIMIT_S = 4.0, 90.0, 1200.0
PASSED, FAILED, LATE = 0, 1, (124, 137, -9)


def copied(folder: Path) -> Path:
    """Copy the files that git tracks or would track; return the folder."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True
    )
    for name in listed.stdout.decode().splitlines():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def run_tests(folder: Path, tests: str, ranks: int, limit: float) -> tuple[int, list[str]]:
    """Return the exit status of tests in a folder at this number of ranks, and the names of failed tests.

    `tests` are pytest files or hostile cases; the latter have no names.
    """
    is_hostile = tests.startswith("hostile ")
    words = [sys.executable, "-m", *([] if is_hostile else PYTEST), *shlex.split(tests)]
    command = words if ranks == 1 else ["mpirun", "--oversubscribe", "-n", str(ranks), *words, "-m", "parallel"]
    paths = ":".join(str(folder / name) for name in ("", "tests", "scripts"))
    environment = os.environ | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    job = ["timeout", "--kill-after=10", str(limit), *command]
    done = subprocess.run(job, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, NOTICED.findall(done.stdout)


def time_of(folder: Path, tests: str, ranks: int) -> float | None:
    """Return the seconds that tests take without an error; None if they fail."""
    begin = time.monotonic()
    return time.monotonic() - begin if run_tests(folder, tests, ranks, LIMIT_S)[0] == PASSED else None


def outcome(
    folder: Path, mutation: tuple[str, str, str], tests: str, ranks: int, limit: float
) -> tuple[str, list[str]]:
    """Insert an error, run the tests and remove it; return its outcome and the failed tests."""
    name, old, new = mutation
    path = folder / name
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        return f"not tried: {text.count(old)} such lines", []
    path.write_text(text.replace(old, new), encoding="utf-8")
    try:
        status, names = run_tests(folder, tests, ranks, limit)
    finally:
        path.write_text(text, encoding="utf-8")
    if status not in (PASSED, FAILED, *LATE):
        return f"not tried: status {status}", names
    return ("SURVIVED" if status == PASSED else "killed"), names


def main(words: list[str]) -> int:
    groups = tomllib.loads(TABLE.read_text(encoding="utf-8"))["group"]
    alive = tried = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = copied(Path(temporary))
        takes = cache(lambda tests, ranks: time_of(folder, tests, ranks))
        for group in groups:
            tests, ranks = group["tests"], group.get("ranks", 1)
            for mutation in group["lines"]:
                line = f"{mutation[0]}: {mutation[2]}   [{ranks}: {tests}]"
                if words and not any(word in line for word in words):
                    continue
                alone = takes(tests, ranks)
                limit = max(LEAST_S, TIMES * (alone or 0.0))
                failed = ("not tried: tests fail", [])
                found, names = outcome(folder, mutation, tests, ranks, limit) if alone else failed
                tried, alive = tried + 1, alive + (found != "killed")
                print(f"{found:10} {line}", *(f"{'':10} {name}" for name in names), sep="\n", flush=True)
    print(f"{tried - alive} of {tried} killed")
    return int(alive > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("word", nargs="*", help="try only errors whose printed line has one of the words")
    sys.exit(main(parser.parse_args().word))
