"""The words of the command line: ours (double dash) and PETSc's (single dash)."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence

from feti_homog.petsc.option_values import flag_value, is_flag, is_flag_value, is_own_flag

OWN_SHORT = ("-h",)
CASE_FILE = ".toml"


def split_argv(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words that are ours and those that are PETSc's, each in their order.

    PETSc's are single-dash options with the word after each as its value, unless that word begins another option
    or cannot be the value; a negative number can.
    """
    ours: list[str] = []
    petsc: list[str] = []
    name = ""
    for word in argv:
        if _is_petsc(word):
            petsc.append(word)
            name = word[1:]
        elif name and not word.startswith("--") and word not in OWN_SHORT and _may_be_value(name, word):
            petsc.append(word)
            name = ""
        else:
            ours.append(word)
            name = ""
    return ours, petsc


def named_values(words: Sequence[str]) -> dict[str, str]:
    """PETSc's words of the command line by name without dash; the text is empty where there is no value."""
    values: dict[str, str] = {}
    name = ""
    for word in words:
        if _is_petsc(word):
            name = word[1:].lower()  # PETSc takes names in either case
            values[name] = ""
        else:
            values[name] = word
    return values


def petsc_words(options: Mapping[str, str]) -> list[str]:
    """Return the words of options by name without dash, for PETSc's start.

    Its own flags are there or not, true or false.

    False flags of the solver stay, for a case may have them true.
    """
    kept = {name: flag_value(text) if is_own_flag(name) else text for name, text in options.items()}
    words = [(f"-{name}", text) for name, text in kept.items() if text is not None]
    return [word for pair in words for word in pair if word]


def _is_petsc(word: str) -> bool:
    return re.match(r"-[A-Za-z]", word) is not None and word not in OWN_SHORT


def _may_be_value(name: str, word: str) -> bool:
    """Return whether a word is the value, right or wrong, of the option before it.

    A value is no case file, and no path after a flag.
    """
    if word.endswith(CASE_FILE) and name != "options_file":
        return False
    return not is_flag(name) or is_flag_value(word) or not _is_path(word)


def _is_path(word: str) -> bool:
    return os.sep in word or os.path.exists(word)
