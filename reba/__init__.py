"""Exact REBA scores (Hignett & McAtamney 2000) from recordings of posture.

>>> import pandas as pd
>>> import reba
>>> frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
>>> scores = reba.score(frames, load=12.0)
>>> scores.data[["reba_low", "reba_high"]].values.tolist()
[[3, 11], [4, 12]]
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from reba.errors import PostureError, ProfileError, ReadError, RebaError, RulesError
from reba.factors import Factors
from reba.posture import COLUMNS, PostureTable, Quality
from reba.rules import PRESETS, Rules
from reba.scores import Scores, score
from reba.scoring import PartScores, ScoreArrays, score_array, score_parts
from reba.tables import ACTION_LEVELS, TABLE_A, TABLE_B, TABLE_C

if TYPE_CHECKING:
    from reba.readers import read
    from reba.writers import write_postures, write_scores

try:
    __version__ = version("dreba")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "0+unknown"

__all__ = [
    "ACTION_LEVELS",
    "COLUMNS",
    "PRESETS",
    "TABLE_A",
    "TABLE_B",
    "TABLE_C",
    "Factors",
    "PartScores",
    "PostureError",
    "PostureTable",
    "ProfileError",
    "Quality",
    "ReadError",
    "RebaError",
    "Rules",
    "RulesError",
    "ScoreArrays",
    "Scores",
    "read",
    "score",
    "score_array",
    "score_parts",
    "write_postures",
    "write_scores",
]

# Reading and writing load what formats need; scoring alone should not pay for them.
_LATE = {"read": "reba.readers", "write_postures": "reba.writers", "write_scores": "reba.writers"}


def __getattr__(name: str) -> Any:
    if name in _LATE:
        from importlib import import_module

        return getattr(import_module(_LATE[name]), name)
    raise AttributeError(f"module 'reba' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
