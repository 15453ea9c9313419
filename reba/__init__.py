"""Exact REBA scores (Hignett & McAtamney 2000) from recordings of posture.

>>> import pandas as pd
>>> import reba
>>> frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
>>> scores = reba.score(frames, load=12.0)
>>> scores.data[["reba_low", "reba_high"]].values.tolist()
[[3, 11], [4, 12]]
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of typing takes long to import, and Ctrl-C is not handled yet
if TYPE_CHECKING:
    from typing import Any

    from reba._version import __version__
    from reba.analysis.improve import Improvement
    from reba.analysis.worksheet import Worksheet
    from reba.camera import camera_pictures
    from reba.errors import PostureError, ProfileError, RadiansWarning, ReadError, RebaError, RulesError
    from reba.method.distribution import ScoreDistribution, score_probabilities
    from reba.method.measurement_error import MeasurementError
    from reba.method.rules import PRESETS, Rules
    from reba.method.scoring import SCORE_COLUMNS, PartScores, ScoreArrays, score_array, score_parts
    from reba.method.tables import ACTION_LEVELS, TABLE_A, TABLE_B, TABLE_C
    from reba.posture.columns import COLUMNS
    from reba.posture.factors import FACTORS, Factors
    from reba.posture.named_angles import angle_table
    from reba.posture.table import PostureTable, Quality
    from reba.readers import read, read_blocks
    from reba.readers.info import Info, StreamInfo, info
    from reba.report import write_report
    from reba.scored_files import compare, read_scores
    from reba.scores import Scores, score
    from reba.writers import write_postures, write_scores

__all__ = [
    "ACTION_LEVELS",
    "COLUMNS",
    "FACTORS",
    "PRESETS",
    "SCORE_COLUMNS",
    "TABLE_A",
    "TABLE_B",
    "TABLE_C",
    "Factors",
    "Improvement",
    "Info",
    "MeasurementError",
    "PartScores",
    "PostureError",
    "PostureTable",
    "ProfileError",
    "Quality",
    "RadiansWarning",
    "ReadError",
    "RebaError",
    "Rules",
    "RulesError",
    "ScoreArrays",
    "ScoreDistribution",
    "Scores",
    "StreamInfo",
    "Worksheet",
    "__version__",
    "angle_table",
    "camera_pictures",
    "compare",
    "info",
    "read",
    "read_blocks",
    "read_scores",
    "score",
    "score_array",
    "score_parts",
    "score_probabilities",
    "write_postures",
    "write_report",
    "write_scores",
]
_LAZY = {
    "reba._version": ("__version__",),
    "reba.analysis.improve": ("Improvement",),
    "reba.analysis.worksheet": ("Worksheet",),
    "reba.camera": ("camera_pictures",),
    "reba.errors": ("PostureError", "ProfileError", "RadiansWarning", "ReadError", "RebaError", "RulesError"),
    "reba.method.distribution": ("ScoreDistribution", "score_probabilities"),
    "reba.method.measurement_error": ("MeasurementError",),
    "reba.method.rules": ("PRESETS", "Rules"),
    "reba.method.scoring": ("SCORE_COLUMNS", "PartScores", "ScoreArrays", "score_array", "score_parts"),
    "reba.method.tables": ("ACTION_LEVELS", "TABLE_A", "TABLE_B", "TABLE_C"),
    "reba.posture.columns": ("COLUMNS",),
    "reba.posture.factors": ("FACTORS", "Factors"),
    "reba.posture.named_angles": ("angle_table",),
    "reba.posture.table": ("PostureTable", "Quality"),
    "reba.readers": ("read", "read_blocks"),
    "reba.readers.info": ("Info", "StreamInfo", "info"),
    "reba.report": ("write_report",),
    "reba.scored_files": ("compare", "read_scores"),
    "reba.scores": ("Scores", "score"),
    "reba.writers": ("write_postures", "write_scores"),
}
"""Imported on first use: the commands handle interrupts before NumPy and pandas are imported."""


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for module, names in _LAZY.items():
        if name in names:
            value = globals()[name] = getattr(import_module(module), name)
            return value
    raise AttributeError(f"module 'reba' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
