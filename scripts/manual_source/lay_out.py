"""Lay out the input of Sphinx: the documents, placed as in the repository, and the pages made from the code.

Usage: lay_out.py FOLDER
"""

import os
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))
os.environ["COLUMNS"] = "100"  # of the commands' help

import reference_pages  # noqa: E402

FOLDERS = ("drivers", "feti_homog", "meshes", "scripts", "tests")
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "manual_source")


def main(target: Path) -> None:
    for folder in FOLDERS:  # whole folders, for documents link to files
        shutil.copytree(ROOT / folder, target / folder, ignore=LEFT_OUT)
    for path in (*ROOT.glob("*.md"), ROOT / "LICENSE", *HERE.glob("*.md")):
        shutil.copy2(path, target)
    reference_pages.write(target / "reference")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
