"""Damage to the bytes of a file, for tests of what reads it."""

import numpy as np

# What stands in the place of a number: of the wrong kind, beyond the last, or too large.
NUMBERS = (
    *(b"0", b"-1", b"1", b"2", b"3", b"9", b"15", b"77", b"2.5", b"nan", b"-inf", b"1e30", b"x", b"\x1b[31m", b"0x10"),
    *(b"65536", b"2147483647", b"4294967296", b"1000000000000", b"9223372036854775807", b"99999999999999999999"),
)
WORDS = (
    *(b"$Nodes\n", b"$EndNodes\n", b"$Elements\n", b"$EndElements\n", b"$Foo\n", b"$MeshFormat\n4.1 1 8\n", b'"', b","),
    *(b'SystemCall "touch executed";\n', b"*NODE\n", b"*ELEMENT\n", b"<", b"/>", b"\0\0\0\0", b"\xff\xff\xff\xff"),
)


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the content after one to three mutations."""
    for _ in range(rng.integers(1, 4)):
        content = _KINDS[rng.integers(len(_KINDS))](content, rng)
    return content


def _place(content: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(content) + 1))


def _cut_off(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: _place(content, rng)]


def _byte(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + bytes([rng.integers(256)]) + content[at + 1 :]


def _bit(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + bytes(b ^ (1 << rng.integers(8)) for b in content[at : at + 1]) + content[at + 1 :]


def _left_out(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + content[at + rng.integers(1, 40) :]


def _twice(content: bytes, rng: np.random.Generator) -> bytes:
    at, to = _place(content, rng), _place(content, rng)
    return content[:to] + content[at : at + rng.integers(1, 200)] + content[to:]


def _inserted(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + WORDS[rng.integers(len(WORDS))] + content[at:]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace a word."""
    words = content.split(b" ")
    words[rng.integers(len(words))] = NUMBERS[rng.integers(len(NUMBERS))]
    return b" ".join(words)


def _count(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace a line, maybe one with a count."""
    lines = content.split(b"\n")
    lines[rng.integers(len(lines))] = NUMBERS[rng.integers(len(NUMBERS))]
    return b"\n".join(lines)


def _whole(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace four or eight bytes by a whole number."""
    at, size = _place(content, rng), int(rng.choice([4, 8]))
    value = int(rng.choice([-1, 0, 1, 2, 3, 21, 255, 65536, 2**31 - 1, 2**62])) % 2 ** (8 * size)
    return content[:at] + value.to_bytes(size, "little") + content[at + size :]


_KINDS = (_cut_off, _byte, _bit, _left_out, _twice, _inserted, _number, _number, _count, _whole)
