"""Limits that a shell or a batch system sets, and under which the program would hang or crash without a word."""

from __future__ import annotations

import resource

from feti_homog.errors import FetiHomogError

# Bytes: of a stack, with a quarter of which MPI does not start; of the addresses of a small run on one rank.
STACK, ADDRESSES = 1 << 20, 1 << 30


def require() -> None:
    """Check the limits of the stack and of addresses, before libraries are loaded.

    Raises:
        FetiHomogError: one is too small; a line for each.
    """
    least = (("stack (ulimit -s)", resource.RLIMIT_STACK, STACK), ("memory (ulimit -v)", resource.RLIMIT_AS, ADDRESSES))
    faults = [
        f"the {name} of the process is limited to {limit >> 10} KiB; expected at least {needed >> 10} KiB"
        for name, kind, needed in least
        if (limit := resource.getrlimit(kind)[0]) != resource.RLIM_INFINITY and limit < needed
    ]
    if faults:
        raise FetiHomogError(*faults)


def limits_addresses() -> bool:
    """Return whether the process may have so many addresses only."""
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
