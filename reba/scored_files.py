"""Files of scores, read back: worksheets, improvements and comparisons without the recording.

file of `reba score -o` -> posture table with what was recorded -> scored again by the recorded rules, and compared
"""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any, Final

import numpy as np

from reba.analysis.exposure import compare as compare_scores
from reba.analysis.score_table import ScoreTable
from reba.checks import PATH, Allowed, accepts, from_home
from reba.errors import PostureError, RebaError, RulesError, warn_user
from reba.method.rules import Rules
from reba.posture.factors import Factors
from reba.posture.table import PostureTable
from reba.provenance import MEMBER, other_version
from reba.readers import read
from reba.scores import Scores, score

RANGE: Final = ("reba_low", "reba_high")
"""Columns that are compared: they depend on angles, factors and rules alone."""
MISSING: Final = ("range", "neutral", "worst", "error")


def recorded_rules(postures: PostureTable) -> Rules | None:
    """Return the rules that a score table was recorded with, None for others and where the file does not say.

    Raises:
        RulesError: this version does not know them.
    """
    rules = (postures.scored or {}).get("rules")
    if not isinstance(rules, dict):
        return None
    try:
        return Rules().replace(**rules)
    except (RulesError, TypeError) as error:
        origin = other_version((postures.scored or {}).get(MEMBER))
        by = f" by {origin}" if origin else ""
        raise RulesError(
            f"{postures.source}: it was recorded{by} with rules that this version does not know ({error}); name the "
            "rules to score by"
        ) from error


def score_recorded(postures: PostureTable, **options: Any) -> Scores:
    """Score the postures of a score table by the rules that it was recorded with.

    Args:
        **options: as of `reba.score`, apart from the rules.

    Warns:
        UserWarning: the file does not say by which rules, or the scores differ from those in the file.
    """
    rules = recorded_rules(postures)
    if rules is None:
        warn_user(f"{postures.source}: it does not say by which rules it was scored; 'measured' is used")
    scores = score(postures, rules=rules or "measured", **options)
    scores = dataclasses.replace(scores, factors=_constants(scores.factors))
    causes = (postures.scored or {}).get("activity")
    if isinstance(causes, dict) and all(isinstance(shares, dict) for shares in causes.values()):
        scores = dataclasses.replace(scores, activity_causes=causes)
    differ = np.zeros(len(scores.data), bool)
    for name in RANGE:
        differ |= scores.data[name].to_numpy(np.float64) != postures.data[name].to_numpy(np.float64, na_value=np.nan)
    if differ.any():
        origin = other_version((postures.scored or {}).get(MEMBER))
        by = f", which {origin} wrote" if origin else ""
        warn_user(f"{postures.source}: {int(differ.sum())} of {len(differ)} scores differ from those in the file{by}")
    return scores


def _constants(factors: Factors) -> Factors:
    """Return factors with one value in the place of equal values of all frames."""
    values = {field.name: getattr(factors, field.name) for field in dataclasses.fields(factors)}
    equal = {name: value[0].item() for name, value in values.items() if np.ndim(value) and (value == value[:1]).all()}
    return dataclasses.replace(factors, **equal)


@accepts(RebaError, path=PATH)
def read_scores(path: str | Path) -> Scores:
    """Read a file that `reba score -o` or `write_scores` wrote (.parquet, .csv, .mcap, .xlsx) back into scores.

    The postures in the file are scored again by the rules and with the factors that it was recorded with; times are
    those of the recording, which is not needed.

    Raises:
        ReadError: the file cannot be read, or holds scores without angles.
        RebaError: it holds no scores, or was recorded with rules that this version does not know.

    Warns:
        UserWarning: the file does not say by which rules, or its scores differ from those of this version.

    Example:
        >>> import tempfile, pandas, reba
        >>> frames = pandas.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
        >>> file = Path(tempfile.mkdtemp(), "scores.parquet")
        >>> reba.write_scores(reba.score(frames, rules="paper", load=12.0), file)
        >>> scores = read_scores(file)
        >>> scores.rules.name, scores.factors.load, scores.data["reba_high"].tolist()
        ('paper', 12.0, [11, 12])
    """
    postures = read(path)
    if postures.scored is None:
        raise RebaError(f"{path}: it holds no scores; read it with reba.read and score it with reba.score")
    missing = postures.scored.get("missing")
    return score_recorded(postures, missing=missing if missing in MISSING else "range")


COMPARED: Final = Allowed(
    "what reba.score returns, or the path of a file of scores",
    lambda value: isinstance(value, ScoreTable) or PATH.fits(value),
    from_home,
)


@accepts(PostureError, a=COMPARED, b=COMPARED)
def compare(a: ScoreTable | str | Path, b: ScoreTable | str | Path) -> dict[str, Any]:
    """Return the summaries of two recordings and b minus a for every figure both have.

    Part means are compared over frames in which they are known; a figure that one side lacks has no difference.

    Args:
        a, b: scores, or files of scores as of `read_scores`.

    Warns:
        UserWarning: a file of scores was recorded with other rules than the other side.
    """
    first, second = (read_scores(each) if isinstance(each, str | os.PathLike) else each for each in (a, b))
    if first is not a or second is not b:
        names = first.rules.name, second.rules.name
        if first.rules != second.rules:
            warn_user(f"compare: the scores were recorded with different rules, {names[0]!r} and {names[1]!r}")
    return compare_scores(first, second)
