"""The ranks of a job of `standing_jobs.py`: they run the programs whose words come through their FIFO."""

import json
import os
import runpy
import sys
from pathlib import Path


def serve(folder: Path, rank: int) -> None:
    """Run the programs whose words come to this rank, until nobody is there to send any."""
    ended = os.open(folder / "ended", os.O_WRONLY)
    with (folder / f"words-{rank}").open(encoding="utf-8") as lines:
        for line in lines:
            out, err, program, *words = json.loads(line)
            for stream, path in ((1, out), (2, err)):
                end = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
                os.dup2(end, stream)
                os.close(end)
            code = run(program, words)
            sys.stdout.flush()
            sys.stderr.flush()
            os.write(ended, f"{code}\n".encode())


def run(program: str, words: list[str]) -> int:
    """Run `python program words...`, or the command line for "-m feti_homog", in this process."""
    from feti_homog import cli

    try:
        if program == "-m":
            return cli.main(words[1:])
        sys.argv = [program, *words]
        runpy.run_path(program, run_name="__main__")
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2] / "drivers"))
    serve(Path(sys.argv[1]), int(os.environ.get("OMPI_COMM_WORLD_RANK", "0")))
