"""Count the steps of Python's regular expressions, without a clock."""

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

CHARACTERS = {"LITERAL", "NOT_LITERAL", "ANY", "IN"}
LIMIT = 20_000  # steps, above the steps of all linear patterns on texts of some hundred characters

Ends = Callable[[int], Iterable[int]]  # places at which an item that begins at a place ends, the preferred one first


class Backtracking:
    """Match texts in the order in which `re` does; a step compares a character or tries an end."""

    def __init__(self, pattern: re.Pattern[Any]) -> None:
        self._pattern, self._text, self._steps = pattern, pattern.pattern[:0], 0
        self._ends = self._sequence(re._parser.parse(pattern.pattern, pattern.flags))  # type: ignore[attr-defined]

    def steps(self, method: str, text: Any) -> int:
        """Return the steps on a text, at most LIMIT; spans must equal the spans of `re`."""
        self._text, self._steps = text, 0
        try:
            spans = self._spans(method)
        except OverflowError:
            return LIMIT
        expected = self._pattern.finditer(text)
        if method in ("match", "fullmatch", "search"):
            expected = filter(None, [getattr(self._pattern, method)(text)])
        assert spans == [match.span() for match in expected]
        return self._steps

    def _spans(self, method: str) -> list[tuple[int, int]]:
        spans, begin, is_empty = list[tuple[int, int]](), 0, False
        while begin <= len(self._text):
            ends = (end for end in self._ends(begin) if end > begin or not is_empty)
            if method == "fullmatch":
                ends = (end for end in ends if end == len(self._text))
            spans += [(begin, end) for end, _ in zip(ends, "1", strict=False)]
            if method in ("match", "fullmatch") or (method == "search" and spans):
                break
            is_found = bool(spans) and spans[-1][0] == begin and not (is_empty and spans[-1] == (begin, begin))
            begin, is_empty = (spans[-1][1], spans[-1][1] == begin) if is_found else (begin + 1, False)
        return spans

    def _sequence(self, tree: Any) -> Ends:
        """Return the ends of a sequence of items."""
        items = [self._item(tree[place : place + 1]) for place in range(len(tree))]

        def ends(begin: int, first: int = 0) -> Iterator[int]:
            if first == len(items):
                yield begin
            else:
                for end in items[first](begin):
                    yield from ends(end, first + 1)

        return items[0] if len(items) == 1 else ends

    def _item(self, item: Any) -> Ends:
        operation, argument = str(item[0][0]), item[0][1]
        if operation == "AT" or operation in CHARACTERS or (operation[:6] == "ASSERT" and argument[0] < 0):
            return self._single(item, int(operation in CHARACTERS))
        if operation in ("ASSERT", "ASSERT_NOT"):
            ahead = self._sequence(argument[1])
            return lambda begin: [begin] * (any(True for _ in ahead(begin)) == (operation == "ASSERT"))
        if operation == "BRANCH":
            choices = [self._sequence(choice) for choice in argument[1]]
            return lambda begin: (end for choice in choices for end in choice(begin))
        if operation == "SUBPATTERN":
            return self._sequence(argument[3])
        if operation == "ATOMIC_GROUP":
            group = self._sequence(argument)
            return lambda begin: [end for end, _ in zip(group(begin), "1", strict=False)]
        least, most, items = argument
        repeat = self._repeat(self._sequence(items), least, most, is_greedy=operation != "MIN_REPEAT")
        if operation == "POSSESSIVE_REPEAT":
            return lambda begin: [end for end, _ in zip(repeat(begin), "1", strict=False)]
        assert operation in ("MAX_REPEAT", "MIN_REPEAT"), operation
        return repeat

    def _single(self, item: Any, width: int) -> Ends:
        """Return the end of a character, a position or a condition on the text before."""
        holds = re._compiler.compile(item, self._pattern.flags).match  # type: ignore[attr-defined]

        def ends(begin: int) -> tuple[int, ...]:
            self._count()
            return (begin + width,) if holds(self._text, begin) else ()

        return ends

    def _repeat(self, items: Ends, least: int, most: int, is_greedy: bool) -> Ends:
        def ends(begin: int, count: int = 0) -> Iterator[int]:
            if not is_greedy and count >= least:
                yield begin
            if count < most:
                for end in items(begin):
                    if end > begin or count < least:
                        yield from ends(end, count + 1)
            if is_greedy and count >= least:
                self._count()
                yield begin

        return ends

    def _count(self) -> None:
        self._steps += 1
        if self._steps >= LIMIT:
            raise OverflowError
