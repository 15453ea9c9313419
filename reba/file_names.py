"""Names of files as pages show them: without their folders, which may name a person, a customer or a computer."""

from __future__ import annotations

from pathlib import PurePath


def file_name(path: str) -> str:
    """Return the last part of a path of any system.

    >>> file_name(r"C:\\Ann\\shift.mcap"), file_name("shift.mcap")
    ('shift.mcap', 'shift.mcap')
    """
    return PurePath(path.replace("\\", "/")).name or path


def word_without_folder(word: str) -> str:
    """Return a word of a command line with a path in it cut to its last part.

    >>> word_without_folder("--manifest=/data/ann/who.csv"), word_without_folder("--load")
    ('--manifest=who.csv', '--load')
    """
    option, equals, value = word.partition("=") if word.startswith("-") else ("", "", word)
    return f"{option}{equals}{file_name(value)}" if "/" in value or "\\" in value else word


def text_without_folders(text: str, path: str) -> str:
    """Return a message about a file without the folder of that file.

    >>> text_without_folders("/data/ann/a.csv: no column 'time'", "/data/ann/a.csv")
    "a.csv: no column 'time'"
    """
    return text.replace(path, file_name(path))
