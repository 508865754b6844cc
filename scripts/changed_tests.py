"""Print the test files that a change touches: changed files, and files that import a changed module.

`.venv/bin/python scripts/changed_tests.py [COMMIT]` takes the changes since COMMIT, by default HEAD~1, and new files.
Modules of `tests/` that are no tests pass a change on to all files that import them.
"""

import ast
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ON_PATH = ("tests/", "scripts/", "drivers/", "")  # as pytest has it


def changed(commit: str) -> set[str]:
    """Return the paths of new files and of files that differ from a commit."""
    differ = ["git", "diff", "--name-only", commit], ["git", "ls-files", "--others", "--exclude-standard"]
    listed = (subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout for words in differ)
    return {name for text in listed for name in text.splitlines()}


def module_name(path: str) -> str:
    """Return the name by which a file is imported."""
    prefix = next(prefix for prefix in ON_PATH if path.startswith(prefix))
    return path[len(prefix) :].removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def imports(path: Path) -> set[str]:
    """Return the modules that a file imports, and the names that may be modules."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.update({node.module} | {f"{node.module}.{alias.name}" for alias in node.names})
    return names


def touched(files: set[str]) -> list[str]:
    """Return the changed test files, and those that import a changed file, even through other test modules."""
    of_tests = {path.relative_to(ROOT).as_posix(): imports(path) for path in sorted((ROOT / "tests").rglob("*.py"))}
    found = files & of_tests.keys()
    modules = {module_name(name) for name in files if name.endswith(".py")}
    while new := {name for name, imported in of_tests.items() if imported & modules} - found:
        found |= new
        modules |= {module_name(name) for name in new}
    return sorted(name for name in found if Path(name).name.startswith("test_"))


if __name__ == "__main__":
    print("\n".join(touched(changed(sys.argv[1] if len(sys.argv) > 1 else "HEAD~1"))))
