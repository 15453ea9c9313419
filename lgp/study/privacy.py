"""Labels of participants and folders are left out of the report of a study; its tables and summary have them.

Labels that are numbers, also behind a word such as participant, tell nothing of a person and stay.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from typing import Any, Final

from reba.file_names import file_name, text_without_folders, word_without_folder

_CODE: Final = re.compile(r"(?:p|s|sim|sub|subj|subject|participant|person|user|id|vp)?[ _-]?\d+", re.IGNORECASE)
_CONDITIONS: Final = {"conditions", "ignored_conditions", "condition", "first", "second"}
"""Members that name conditions, which stay as they are."""
WITHOUT_NAMES: Final = (
    "Privacy: this page contains scores, conditions and the names of files without folders. Labels of participants "
    "that may be names are numbered in their alphabetical order, in the names of files too. The page is complete in "
    "one file and has no network access."
)
WITH_NAMES: Final = (
    "Privacy: this page contains, as was asked for, labels of participants and paths of their recordings. It is "
    "complete in one file and has no network access."
)


def without_names(summary: Mapping[str, Any], command: str) -> tuple[dict[str, Any], str]:
    """Return a summary and a command line without labels of participants and folders.

    >>> recordings = [{"participant": "Ann", "input": "/data/Ann_a.mcap"}]
    >>> summary = {"participants": ["Ann", "p02"], "recordings": recordings}
    >>> hidden, command = without_names({**summary, "failed": []}, "lgp study /data/Ann_a.mcap")
    >>> hidden["participants"], hidden["recordings"], command
    (['[name 1]', 'p02'], [{'participant': '[name 1]', 'input': '[name 1]_a.mcap'}], "lgp study '[name 1]_a.mcap'")
    """
    people = sorted(map(str, summary["participants"]))
    numbered = {name: f"[name {number}]" for number, name in enumerate(people, 1) if not _CODE.fullmatch(name)}
    files = sorted((str(one["input"]) for one in (*summary["recordings"], *summary["failed"])), key=len, reverse=True)
    pattern = "|".join(re.escape(name) for name in sorted(numbered, key=len, reverse=True))
    names_in = re.compile(rf"(?<![^\W_])(?:{pattern})(?![^\W_])") if pattern else None

    def hide(text: str) -> str:
        for file in files:
            text = text_without_folders(text, file)
        return text if names_in is None else names_in.sub(lambda match: numbered[match[0]], text)

    words = [hide(word_without_folder(word)) for word in _words(command)]
    hidden = {key: _walked(value, key, hide, numbered) for key, value in summary.items()}
    return hidden, shlex.join(words)


def _walked(value: Any, key: str, hide: Callable[[str], str], numbered: Mapping[str, str]) -> Any:
    """Return a part of a summary with every text hidden, and the keys that are labels or files."""
    if key in _CONDITIONS and not isinstance(value, Mapping):
        return value
    if isinstance(value, Mapping):
        shown: dict[str, Any] = {}
        for name, one in value.items():
            label = numbered.get(name, name) if key == "participants" else hide(name) if key == "notes" else name
            shown[label] = _walked(one, str(name), hide, numbered)
        return shown
    if isinstance(value, list | tuple):
        return [_walked(one, "", hide, numbered) for one in value]
    if key == "input" and isinstance(value, str):
        return hide(file_name(value))
    return hide(value) if isinstance(value, str) else value


def _words(command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError:  # a text that no shell wrote
        return []
