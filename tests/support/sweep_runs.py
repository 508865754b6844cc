"""Sweeps by the command line, and what they leave in their folder."""

from pathlib import Path

from support.command_line import in_process, on_ranks

TWO = "cell.fibre_fraction = [0.2, 0.3]\n"


def results(out: Path) -> dict[str, int]:
    """When each result was written."""
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in out.glob("case-*/result.json")}


def contents(out: Path) -> dict[Path, bytes]:
    """Return the contents of all files but the locks."""
    return {path: path.read_bytes() for path in out.rglob("*") if path.is_file() and "lock" not in path.name}


def swept(out: Path, path: Path, *words: str, ranks: int = 0, code: int = 0):
    """Run a sweep on so many ranks; none: in the process of the test."""
    job = on_ranks(ranks, "sweep", path, "--out", out, *words)
    assert job.returncode == code, job.stdout + job.stderr
    assert "Traceback" not in job.stderr
    return job


def collected(out: Path):
    job = in_process("collect", out)
    assert job.returncode == 0, job.stderr
    return job
