"""Events of a checkpoint under right checksums: damaged, or with wrong numbers."""

import json
import os
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.results import checkpoints, result_json
from hostile.attempts import Attempt, copy_of
from hostile.results import COMMANDS, PREPARED, replaced


def in_events(change: Callable[[list[checkpoints.Arrays]], Any]) -> Callable[[Path], None]:
    """Return a function that changes the events of a checkpoint, or returns others, and renews their checksums."""

    def make(path: Path) -> None:
        signature, *contents = [content for _, content in checkpoints.records(path)]
        events = [checkpoints.unpacked(content) for content in contents]
        events = change(events) or events
        contents = [event if isinstance(event, bytes) else checkpoints.packed(event) for event in events]
        path.write_bytes(checkpoints.begin(signature.decode()) + b"".join(map(checkpoints.record, contents)))

    return make


@cache
def bomb() -> bytes:
    """Return a gigabyte of zeros, compressed in parts."""
    stream, part = zlib.compressobj(1), bytes(1 << 24)
    return b"".join(stream.compress(part) for _ in range(64)) + stream.flush()


EVENTS: dict[str, Callable[[Path], None]] = {
    "a gigabyte of zeros": in_events(lambda events: [*events, bomb()]),
    "zeros": in_events(lambda events: [*events, zlib.compress(bytes(1000))]),
    "no compression": in_events(lambda events: [*events, b"[]"]),
    "an array of objects": in_events(lambda events: [*events, zlib.compress(b'[["a", "O", [1]]]\n12345678')]),
}


def with_array(name: str, change: Callable[[Any], Any], event: int = -1) -> Callable[[Path], None]:
    """Return a function that changes an array of an event, or takes it away by returning None."""

    def falsify(events: list[checkpoints.Arrays]) -> None:
        array = change(events[event].pop(name))
        events[event] |= {} if array is None else {name: np.asarray(array)}

    return in_events(falsify)


def in_point(**entries: Any) -> Callable[[Path], None]:
    return with_array("point", lambda text: result_json.dumps({**json.loads(str(text)), **entries}))


def last_is(value: Any) -> Callable[[Any], Any]:
    return lambda array: np.where(np.arange(array.size) == array.size - 1, value, array).astype(array.dtype)


FALSE_KIND = "false checkpoints"
# Wrong events, which a resumed run finds again.
FALSE: dict[str, Callable[[Path], None]] = {
    "no multipliers but jumps": with_array("lam", lambda _: None),
    "wrong multipliers": with_array("lam", lambda lam: 1.01 * lam),
    "too many jumps": with_array("jump", lambda jump: [*jump, 0.0]),
    "multipliers of half a precision": with_array("lam", lambda lam: lam.astype("f2")),
    "statuses of numbers": with_array("status", lambda status: status.astype(float)),
    "an unknown status": with_array("status", last_is(7)),
    "healed bonds": with_array("status_after", lambda status: 0 * status),
    "endless energies": with_array("energies", last_is(np.inf)),
    "jumps whose squares overflow": with_array("jump", lambda jump: 0 * jump + 1e308, 0),
    "other energies": with_array("energies", lambda energies: 1.01 * energies, 0),
    "another load": with_array("path", lambda path: path * [1.1, 1, 1, 1, 1, 1]),
    "other means": with_array("means", lambda means: 1.001 * means, 0),
    "another count of breaks": with_array("path", lambda path: np.add(path, [0, 0, 0, 0, 1, 0]), 0),
    "events in turn": in_events(lambda events: events[::-1]),
    "an event twice": in_events(lambda events: [*events, events[-1]]),
}
# The points of plots and reports.
FALSE_POINTS: dict[str, Callable[[Path], None]] = {
    "a stress of text": in_point(stress="\x1b[31m"),
    "a stress of two": in_point(stress=[1.0, 2.0]),
    "an endless load": in_point(load_factor=1e300),
    "breaks of text": in_point(broke="\x1b[31m"),
    "a point of nothing": with_array("point", lambda _: "{}"),
    "not a number": with_array("point", lambda text: str(text).replace('"stored": ', '"stored": NaN, "x": ')),
}


def attempts(prepared: Path) -> Iterator[Attempt]:
    """Yield those that resume and plot from such events."""
    resume, plot = ("run", "@/c.toml", "--out", "@/out", "--resume"), COMMANDS["plot"]
    # On other ranks, resume names the ranks first.
    for command, words, expected in (("resume", resume, "/out"), ("plot", plot, "checkpoint")):
        for name, make in EVENTS.items():
            changes = {"checkpoint/events": make, "result_json": os.unlink}
            files = {"c.toml": PREPARED["unfinished"][1], "out": copy_of(prepared / "unfinished", **changes)}
            yield Attempt("checkpoints", f"{name}, {command}", words, expected, files, (2,))
    for tables, words, expected, codes in (
        (FALSE, resume, "is invalid", (3,)),
        (FALSE_POINTS, plot, "damaged", (2,)),
    ):
        for name, make in tables.items():
            changes = {"checkpoint/events": make, "result_json": os.unlink}
            files = {"c.toml": PREPARED["unfinished"][1], "out": copy_of(prepared / "unfinished", **changes)}
            yield Attempt(FALSE_KIND, name, words, expected, files, codes)
    files = {"c.toml": PREPARED["unfinished"][1]}
    files["out"] = copy_of(prepared / "unfinished", events_log=replaced(os.mkfifo))
    yield Attempt(FALSE_KIND, "a pipe for the log", resume, "max_events = 3", files, (3,))
