"""Events in the checkpoint of a run that was ended."""

from pathlib import Path

from feti_homog.results.checkpoints import FOLDER, NAME, records


def count(out: Path | str) -> int:
    """Return how many events a folder of results has, none without a checkpoint."""
    path = Path(out) / FOLDER / NAME
    return max(len([*records(path)]) - 1, 0) if path.exists() else 0
