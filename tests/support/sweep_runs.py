"""Sweeps by the command line, and what they leave in their folder."""

from pathlib import Path

from support.command_line import command_line

TWO = "cell.fibre_fraction = [0.2, 0.3]\n"


def results(out: Path) -> dict[str, int]:
    """When each result was written."""
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in out.glob("case-*/result.json")}


def contents(out: Path) -> dict[Path, bytes]:
    """Return the contents of all files but the locks."""
    return {path: path.read_bytes() for path in out.rglob("*") if path.is_file() and "lock" not in path.name}


def swept(out: Path, path: Path, *words: str, ranks: int = 1, code: int = 0):
    job = command_line(ranks, "sweep", path, "--out", out, *words)
    assert job.returncode == code, job.stdout + job.stderr
    assert "Traceback" not in job.stderr
    return job


def collected(out: Path):
    job = command_line(0, "collect", out)
    assert job.returncode == 0, job.stderr
    return job
