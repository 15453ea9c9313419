"""Texts that are shown: what is not seen becomes an escape code, what people write names with stays."""

from __future__ import annotations

import json

import pytest

from reba.errors import RebaError
from reba.files import as_json
from reba.printable import as_markup, as_script_data, printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b]0;t\x07", r"\x1b]0;t\x07"),
        ("\x7f\x9b31m", r"\x7f\x9b31m"),
        ("\u202etxt.exe\u2069", r"\u202etxt.exe\u2069"),
        ("\u200b\u2028\ufeff\u061c", r"\u200b\u2028\ufeff\u061c"),
        ("\udcff", r"\udcff"),
        ("\U000e0041", r"\U000e0041"),
        ("\ufffe", r"\ufffe"),
        ("a\nb\tc\rd", r"a\nb\tc\rd"),
    ],
)
def test_hidden_characters_are_shown(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert printable(f"left {text} arm") == f"left {shown} arm"


@pytest.mark.parametrize(
    "name", ["Zoë Łuk", "می‌خواهم", "क्‍ष", "10.30\u202fPM", "a\xa0b", "\U0001f469\u200d\U0001f527", r"C:\x1b"]
)
def test_names_of_people_and_files_stay(name: str) -> None:
    assert printable(name) == name


def test_only_what_is_named_is_kept() -> None:
    assert printable("a\n\tb\x1b", keep="\n\t") == "a\n\tb\\x1b"


def test_errors_are_one_line_of_what_is_seen() -> None:
    assert str(RebaError("left\n arm\u202e\x1b")) == r"left arm\u202e\x1b"


def test_markup_is_text() -> None:
    assert (
        as_markup("<a href=\"x\" title='y'>&\x1b\n") == "&lt;a href=&quot;x&quot; title=&#x27;y&#x27;&gt;&amp;\\x1b\n"
    )
    assert "<" not in as_script_data('["<!--</script>\u2028"]')
    assert json.loads(as_script_data('["<!--</script>\u2028"]')) == ["<!--</script>\u2028"]


def test_json_is_printable_ascii() -> None:
    text = "".join(map(chr, (0, 7, 27, 127, 155, 0x202E, 0x2028, 0xDCFF, 0x1F600)))
    written = as_json({text: text})
    assert written.isascii()
    assert written.isprintable()
    assert json.loads(written) == {text: text}
