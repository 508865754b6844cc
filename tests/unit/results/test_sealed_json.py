"""A document is read as it was written, or not at all."""

from __future__ import annotations

import json

import pytest

from feti_homog.results import sealed_json

DOCUMENT = {
    "schema": 1,
    "numbers": [0.1, 1e-300, 3, True, None],
    "unit": "µm",
    "name": "\udcff",
    "table": {"b": 1, "a": 2},
}


def test_what_was_written_is_read():
    text = sealed_json.dumps(DOCUMENT)
    assert sealed_json.loads(text) == DOCUMENT and list(json.loads(text))[-1] == "checksum"
    assert sealed_json.dumps(sealed_json.loads(text)) == text


def test_every_changed_number_or_letter_is_told():
    text = sealed_json.dumps(DOCUMENT)
    for place, letter in enumerate(text):
        if letter.isalnum():
            other = text[:place] + ("7" if letter != "7" else "8") + text[place + 1 :]
            if '"checksum"' in other:
                with pytest.raises(ValueError):
                    sealed_json.loads(other)


def test_another_layout_of_the_same_content_is_right():
    assert sealed_json.loads(json.dumps(json.loads(sealed_json.dumps(DOCUMENT)))) == DOCUMENT


@pytest.mark.parametrize(
    "text", ["", "[", "[]", "3", "[" * 100_000, '{"a": 1', '{"a": 1, "checksum": "0"}', '{"checksum": 1}']
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError):
        sealed_json.loads(text)
