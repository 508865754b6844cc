"""Options of PETSc itself, which no solver reads but PETSc when it starts, logs and ends."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from feti_homog.petsc.option_table import CLOSE, is_in_table

NAMES = (
    *("help", "version", "info", "info_exclude", "history", "citations", "python", "tmp", "shared_tmp"),
    *("log_view", "log_view_memory", "log_view_gpu_time", "log_all", "log_trace", "log_sync", "log_mpe", "log_exclude"),
    *("log_nvtx", "log_perfstubs", "get_total_flops"),
    *("malloc", "malloc_debug", "malloc_dump", "malloc_view", "malloc_view_threshold", "malloc_test", "malloc_info"),
    *("malloc_hbw", "malloc_coalesce", "malloc_requested_size", "memory_view", "objects_dump", "checkstack"),
    *("options_file", "options_file_yaml", "options_string_yaml", "options_left", "options_view", "options_monitor"),
    *("options_monitor_cancel", "options_suppress_deprecated_warnings", "skip_petscrc"),
    *("on_error_abort", "on_error_mpiabort", "on_error_emacs", "on_error_attach_debugger", "error_output_stdout"),
    *("error_output_none", "no_signal_handler", "fp_trap", "start_in_debugger", "stop_for_debugger", "debug_terminal"),
    *("debugger_ranks", "debugger_nodes", "debugger_pause", "check_pointer_intensity", "mpidump"),
)
# More of each beginning, of which every release of PETSc has others.
BEGINNINGS = ("log_", "malloc_", "device_", "cuda_", "hip_", "sf_", "viewer_", "use_gpu_aware_mpi")


def unknown_to_petsc(names: Iterable[str]) -> list[str]:
    """One fault for each name (without dash) that is neither one of PETSc's own nor begins with feti_.

    The solvers of the program have that prefix, so nothing would read it.
    """
    return [f"-{name}: {words}" for name in names if (words := _complaint(name))]


def _complaint(name: str) -> str:
    """Empty if there is none, or if it is one of a name that lacks its prefix, which the solver's options tell."""
    if name in NAMES or name.startswith("feti_") or is_in_table(f"feti_{name}"):
        return ""
    nearest = difflib.get_close_matches(name, NAMES, 1, CLOSE)
    if nearest:
        return f"unknown option; did you mean -{nearest[0]}?"
    known = name.startswith(BEGINNINGS)
    return "" if known else "unknown option; solvers of this program have options that begin with -feti_"
