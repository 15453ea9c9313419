"""Names that a recording gives to people, marker sets and streams are left out of a page, as folders are.

A page is passed on. What it must say of a recording (warnings, assumptions, what was recognised) is made of texts of
the readers, which name subjects, bodies and topics: every such name is replaced in all of them, and paths are cut to
their last part. The name of the file stays: it says which recording the page is about.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any, Final

from reba.analysis.score_table import ScoreTable
from reba.file_names import file_name, word_without_folder
from reba.posture.table import PostureTable

KEPT: Final = {"joints", "frames", "points", "angles", "segments", "table", "markers", "bones", "motion"}
"""Names of streams that are words of the readers' own texts, and tell nothing of a person."""
WITHOUT_NAMES: Final = (
    "Privacy: this page contains angles, scores, times and the names of files. Names that a recording gives to people, "
    "bodies, marker sets and streams are replaced, and folders left out. A name that is part of the name of a file, or "
    "that was typed as task or assessor, is shown. The page is complete in one file and has no network access."
)
WITH_NAMES: Final = (
    "Privacy: this page contains angles, scores, times and, as was asked for, names that recordings give to people, "
    "bodies, marker sets and streams, and paths. It is complete in one file and has no network access."
)


def without_names(scores: ScoreTable) -> ScoreTable:
    """Return the scores with every name and folder replaced in the texts about the recording.

    Example:
        >>> import reba
        >>> scores = reba.score({"trunk_flexion": [10.0]})
        >>> texts = {"topic": "Ann Lee", "recognised": "points of Ann Lee"}
        >>> postures = replace(scores.postures, source="/data/ann/a.c3d", **texts)
        >>> hidden = without_names(replace(scores, postures=postures)).postures
        >>> hidden.source, hidden.topic, hidden.recognised
        ('a.c3d', '', 'points of [name 1]')
    """
    postures = scores.postures
    hide = _hider(postures)
    quality = postures.quality
    accounts = tuple({**one, "stream": hide(str(one.get("stream", "")))} for one in quality.accounts)
    hidden = replace(
        quality,
        first_skipped=None if quality.first_skipped is None else hide(quality.first_skipped),
        ended_abnormally=None if quality.ended_abnormally is None else hide(quality.ended_abnormally),
        time_source=hide(quality.time_source),
        time_why=hide(quality.time_why),
        warnings=tuple(map(hide, quality.warnings)),
        accounts=accounts,
    )
    return replace(
        scores,
        assumed=tuple(map(hide, scores.assumed)),
        postures=replace(
            postures,
            source=file_name(postures.source),
            topic="",
            people=(),
            files=(),
            assumed=tuple(map(hide, postures.assumed)),
            recognised=hide(postures.recognised),
            why_unmeasured={column: hide(why) for column, why in postures.why_unmeasured.items()},
            quality=hidden,
        ),
    )


def command_without_names(command: str, recordings: Sequence[ScoreTable], cameras: Collection[str] = ()) -> str:
    """Return a command line with paths cut to their last part, and the names of the recordings replaced.

    >>> command_without_names("reba score /data/a.mcap --camera /ann/front", [], ["/ann/front"])
    "reba score a.mcap --camera '[camera]'"
    """
    try:
        words = shlex.split(command)
    except ValueError:  # a text that no shell wrote
        return ""
    words = ["[camera]" if word in cameras else word for word in words]
    words = ["--camera=[camera]" if word.removeprefix("--camera=") in cameras else word for word in words]
    for one in recordings:
        words = [_hider(one.postures)(word) for word in words]
    return shlex.join(word_without_folder(word) for word in words)


def _hider(postures: PostureTable) -> Callable[[Any], str]:
    """Return what replaces the names and folders of a recording in a text."""
    stem = PurePath(file_name(postures.source)).name.partition(".")[0]
    streams = [postures.topic, *(str(one.get("stream", "")) for one in postures.quality.accounts)]
    names = dict.fromkeys(name for name in (*postures.people, *streams) if _tells(name, stem))
    numbered = {name: f"[name {number}]" for number, name in enumerate(names, 1)}
    folders = {os.path.dirname(path) for path in (postures.source, *postures.files)} - {"", "/"}
    # Longest first: a name may be part of another one.
    pattern = "|".join(re.escape(name) for name in sorted(numbered, key=len, reverse=True))
    names_in = re.compile(rf"(?<![^\W_])(?:{pattern})(?![^\W_])") if pattern else None

    def hide(text: Any) -> str:
        shown = str(text)
        for folder in sorted(folders, key=len, reverse=True):
            shown = shown.replace(f"{folder}/", "")
        return shown if names_in is None else names_in.sub(lambda match: numbered[match[0]], shown)

    return hide


def _tells(name: str, stem: str) -> bool:
    """Return whether a name may tell who was recorded: numbers, the file's own name and the readers' words do not."""
    return bool(name) and not name.isdigit() and name not in KEPT and name != stem
