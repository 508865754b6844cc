"""Read PETSc's options from the command line and from files before PETSc starts, and check their values."""

import math
import os
import re
import stat
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from feti_homog.system.petsc.option_table import DIRECT_PREFIXES, OPTIONS, SHOWING
from feti_homog.system.runtime import input_files

Value = str | int | float | bool
OptionRule = tuple[str, Callable[[str], bool]]
"""The valid values of an option, in words and as a test of the text; the text is empty without a value."""
TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
VIEWER = re.compile(r"(ascii)?(:(?P<file>[^:]*)(:(default|ascii_\w+)?(:(write|append))?)?)?")
FLAGS = (
    "feti_view", "malloc", "malloc_debug", "malloc_dump", "malloc_test", "malloc_requested_size", "checkstack",
    "log_all", "log_sync", "log_view_memory", "log_view_gpu_time", "get_total_flops", "options_monitor_cancel",
    "options_left", "skip_petscrc", "on_error_abort", "on_error_mpiabort", "no_signal_handler",
)  # fmt: skip
CASE_FILE = ".toml"


def can_be_written(file: str) -> bool:
    """Return whether a file can be opened for writing, or created in its folder.

    The result is False for a pipe without a reader, because opening the pipe would block.
    """
    if not file or "\0" in file or file.endswith(os.sep):
        return False
    try:
        kind = os.stat(file).st_mode
    except FileNotFoundError:
        folder = os.path.dirname(os.path.realpath(file))
        return os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)
    except OSError:  # the name is too long, a folder is a file, or links form a circle
        return False
    if stat.S_ISFIFO(kind):
        try:
            os.close(os.open(file, os.O_WRONLY | os.O_NONBLOCK))
        except OSError:
            return False
    return not stat.S_ISDIR(kind) and os.access(file, os.W_OK)


def faulty_values(options: Mapping[str, Value]) -> list[str]:
    """Return one fault for every option (name without dash) with an invalid value."""
    faults = []
    for name, value in options.items():
        text = _text(value)
        rule = PRINTS if is_viewer(name) else RULES.get(name)
        if rule is not None and not rule[1](text):
            hint = "; there is no such file" if name == "options_file" and not os.path.exists(text) else ""
            faults.append(f"{in_words(name, text)}: expected {rule[0]}{hint}")
    return sorted(faults)


def in_words(name: str, value: str) -> str:
    """Write an option (name without dash) as on the command line."""
    return f"-{name} {value}".strip()


def flag_value(value: Value) -> str | None:
    """Return PETSc's value of a flag: empty for true, None for false, else the text (a viewer)."""
    text = _text(value)
    if text.lower() in FALSE:
        return None
    return "" if text.lower() in TRUE else text


def is_flag(name: str) -> bool:
    """Return whether an option (name without dash) is a flag, which needs no value; see also `is_viewer`."""
    return name in FLAGS or is_viewer(name) or (name.startswith("feti_") and SHOWING.search(name) is not None)


def is_viewer(name: str) -> bool:
    """Return whether an option (name without dash) is a flag whose value may be a PETSc viewer, such as ascii:FILE."""
    return name in ("log_view", "options_view") or (name.startswith("feti_ksp_") and SHOWING.search(name) is not None)


def is_own_flag(name: str) -> bool:
    """Return whether an option (name without dash) is a flag that PETSc reads when it starts or ends."""
    return is_flag(name) and not name.startswith("feti_")


def _text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _real(text: str) -> float:
    """Convert a string to a number, NaN if that is impossible."""
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def _integer(lower: int, upper: int) -> OptionRule:
    def holds(text: str) -> bool:
        return re.fullmatch(r"\+?[0-9]{1,10}", text) is not None and lower <= int(text) <= upper

    return f"an integer of at least {lower} and at most {upper}", holds


def _is_false(text: str) -> bool:
    return text.lower() in FALSE


def _is_switch(text: str) -> bool:
    return text.lower() in ("", *TRUE, *FALSE)


def _is_place(text: str) -> bool:
    """Return whether the text is a switch, or a viewer whose file can be written."""
    match = VIEWER.fullmatch(text)
    return _is_switch(text) or (match is not None and (not match["file"] or can_be_written(match["file"])))


def _words_of(file: str) -> list[str]:
    """Return the words of an options file; [] if unreadable, or if it has other words or names another options file."""
    try:
        lines = input_files.read(Path(file), 1 << 20).decode("utf-8", "replace").splitlines()
    except (OSError, ValueError):  # ValueError: the name has a null character
        return []
    words = [word for line in lines for word in re.split(r"(^|\s)#|^ *[!%]", line)[0].split()]
    return [] if split_argv(words)[0] or "-options_file" in map(str.lower, words) else words


SWITCH: OptionRule = "true or false, or no value", _is_switch
PRINTS: OptionRule = "true or false, no value, or ascii:FILE of an existing folder", _is_place
# A relative tolerance of 1 or more would end every solve at once.
SHARE: OptionRule = "a number above 0 and below 1", lambda text: 0.0 < _real(text) < 1.0
NORMS = ("preconditioned", "unpreconditioned", "natural")
NEW_FILE = "a file of an existing folder, or no value"

RULES: dict[str, OptionRule] = {
    **dict.fromkeys(FLAGS, SWITCH),
    **{
        option.name: (f"one of {option.value.replace('|', ', ')}", option.value.split("|").__contains__)
        for option in OPTIONS
        if "|" in option.value and not option.value.endswith("...")
    },
    **{f"{prefix}ksp_rtol": SHARE for prefix in ("feti_", *DIRECT_PREFIXES)},
    "feti_coarse_threshold": SHARE,
    "feti_ksp_atol": ("a number of at least 0", lambda text: 0.0 <= _real(text) < math.inf),
    "feti_ksp_divtol": ("a number above 1", lambda text: 1.0 < _real(text) < math.inf),
    **dict.fromkeys(("feti_ksp_max_it", "feti_influence_columns"), _integer(1, 2**31 - 1)),  # 32-bit integers of PETSc
    "feti_ksp_type": ("a method that iterates, such as cg", lambda text: text not in ("preonly", "none")),
    "feti_ksp_norm_type": ("preconditioned, unpreconditioned or natural", NORMS.__contains__),
    "feti_schur_mat_mumps_icntl_14": _integer(0, 10_000),
    "feti_schur_mat_mumps_icntl_19": ("no such option: MUMPS would not condense", lambda text: False),
    "feti_schur_mat_mumps_icntl_28": ("0 or 1, because one rank analyses its matrices", ("0", "1").__contains__),
    "feti_schur_pc_type": ("cholesky, because condensed matrices are symmetric", "cholesky".__eq__),
    "feti_schur_pc_factor_mat_solver_type": ("mumps, the only library with Schur complements", "mumps".__eq__),
    "feti_ksp_error_if_not_converged": ("false: a run reports such solves, and keeps its results", _is_false),
    "fp_trap": ("false: the program checks where numbers may not be finite", _is_false),
    **dict.fromkeys(
        ("info", "malloc_view"),  # up to its first colon the text is a switch or a file
        (NEW_FILE, lambda text: _is_switch(text.partition(":")[0]) or can_be_written(text.partition(":")[0])),
    ),
    "options_file": ("a file with one option of PETSc a line, without options_file", lambda text: False),
    "log_trace": (NEW_FILE, lambda text: not text or can_be_written(text)),
}
"""The valid values of options, by name."""


def split_argv(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split a command line into words of the program and words of PETSc.

    Options with a single dash belong to PETSc.  The word after such an option is its value, unless that word begins
    another option or cannot be the value.  A negative number can be a value.
    """
    ours, petsc, name = list[str](), list[str](), ""
    for word in argv:
        if _is_petsc(word):
            petsc.append(word)
            name = word[1:]
        else:
            is_flag_value = _is_switch(word) or VIEWER.fullmatch(word) is not None
            # A case file is never a value, and a path is never the value of a flag.
            is_path = not is_flag_value and (os.sep in word or os.path.exists(word))
            is_ours = re.match("--|-h$", word) or (word.endswith(CASE_FILE) and name != "options_file")
            is_value = name and not is_ours and not (is_flag(name) and is_path)
            (petsc if is_value else ours).append(word)
            name = ""
    return ours, petsc


def named_values(words: Sequence[str]) -> dict[str, str]:
    """Return the values of PETSc's options by name without dash, also from options files.

    An option without a value has an empty string.
    """
    values: dict[str, str] = {}
    name = ""
    for word in words:
        if _is_petsc(word):
            name = word[1:].lower()  # PETSc takes names in either case
            values[name] = ""
        elif name == "options_file" and (inner := _words_of(word)):
            del values[name]
            values |= named_values(inner)
        else:
            values[name] = word
    return values


def petsc_words(options: Mapping[str, str]) -> list[str]:
    """Return the words with which PETSc starts, from options by name without dash.

    A true flag of PETSc itself has no value, a false one is left out.  False solver flags stay, to override the case.
    """
    argv = []
    for name, text in options.items():
        value = flag_value(text) if is_own_flag(name) else text
        if value is not None:
            argv += [f"-{name}", value] if value else [f"-{name}"]
    return argv


def _is_petsc(word: str) -> bool:
    return re.match(r"-(?!h$)[A-Za-z]", word) is not None
