"""Claims of the paper, and what the runs of a summary say of each: shown, not shown, or too few runs to tell.

A difference is shown by a test. That there is none, or none of note, is shown only by an interval inside a margin: a
large p value may come of too few runs. The margins are choices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from lgp.experiments import published
from lgp.experiments.runs import TABLES
from lgp.experiments.summary import ERGONOMIC, NON_ERGONOMIC
from lgp.statistics.formatting import p_text, signed
from lgp.statistics.shares import equivalent
from reba.analysis.wording import percentage_points

ALPHA: Final = 0.05
"""Significance level of a corrected p value."""
SCORE_MARGIN: Final = 0.5
"""[REBA points] Smaller differences of means are no effect of note: half a point."""
SHARE_MARGIN: Final = 0.1
"""Smaller changes of a table's share are no effect of note: ten of a hundred runs."""
HEIGHT_MARGIN: Final = 0.05
"""[m] Smaller differences of the mean height are no effect of note: the paper's is 0.13 m."""
FEWEST_PAIRS: Final = 6
"""Pairs from which an interval can show that there is no effect: with fewer, not even a signed-rank test in which every
difference has the same sign is significant at 5 % (2 / 2^5 = 0.06)."""
FEWEST_EQUAL: Final = 30
"""Runs without any difference that show equality: then at most one in ten runs differs (rule of three, 95 %)."""


@dataclass(frozen=True)
class Finding:
    """Claim of the paper, whether these runs support it (None: too few runs to tell), and the evidence."""

    claim: str
    shown: bool | None
    evidence: str


def findings(summary: Mapping[str, Any]) -> list[Finding]:
    """Claims of the paper, each tested with the runs of a summary."""
    tested = []
    for start, results in summary["starts"].items():
        tested += [
            _order_finding(start, results["reba_grasp"]),
            _choice_finding(start, results),
            _height_finding(start, results["chosen_height"]),
        ]
    if summary["between_starts"] is not None:
        tested.append(_random_start_finding(summary["between_starts"]["reba_grasp"]))
    return tested


def _order_finding(start: str, scores: Mapping[str, Any]) -> Finding:
    """The three means have the order of the paper, every step significant."""
    steps = {frozenset((pair["first"], pair["second"])): pair for pair in scores["pairs"]}
    evidence, shown = [], []
    for low, high in zip(published.EXPECTED_ORDER, published.EXPECTED_ORDER[1:], strict=False):
        pair = steps[frozenset((low, high))]
        sign = 1 if pair["first"] == high else -1
        shown.append(_raised(pair, SCORE_MARGIN, sign))
        evidence.append(f"{high} minus {low} {_text(pair, sign)}")
    claim = f"{start} start: REBA at the grasp {' < '.join(published.EXPECTED_ORDER)}"
    return Finding(claim, _all(shown), "; ".join(evidence) + "; t tests after Holm")


def _choice_finding(start: str, results: Mapping[str, Any]) -> Finding:
    """With the ergonomic cost fewer runs choose the left table, and more the one in the center."""
    change = results["table_change"]
    percent = {name: part["percent"] for name, part in results["table_choice"].items()}
    claim = f"{start} start: with the ergonomic cost the choice moves from the left table to the center"
    plain, ergonomic = percent[NON_ERGONOMIC], percent[ERGONOMIC]
    if change["p"] is None or not change["n"]:
        return Finding(claim, None, f"no test (n = {change['n']})")
    left, center = (change["shares"][table] for table in ("left", "center"))
    shown: bool | None = None
    if left["low"] > -SHARE_MARGIN or center["high"] < SHARE_MARGIN:
        shown = False
    elif all(change["by_choice"][table]["p_holm"] < ALPHA for table in ("left", "center")):
        shown = left["difference"] < 0 < center["difference"]
    shares = ", ".join(
        f"{table} {plain[table]:.0f} to {ergonomic[table]:.0f} % (95 % {_points(change['shares'][table])})"
        for table in TABLES
    )
    exact = ", ".join(f"{table} {p_text(change['by_choice'][table]['p_holm'])}" for table in ("left", "center"))
    test = f"McNemar's exact test after Holm: {exact}, n = {change['n']}"
    return Finding(claim, shown, f"{shares}; {test}")


def _points(share: Mapping[str, float]) -> str:
    return percentage_points(share["low"], share["high"], 0).replace("-", "\N{MINUS SIGN}")


def _height_finding(start: str, heights: Mapping[str, Any]) -> Finding:
    """The chosen table is lower with the ergonomic cost."""
    pair = heights["pairs"][0]
    claim = f"{start} start: with the ergonomic cost the chosen table is lower"
    return Finding(claim, _raised(pair, HEIGHT_MARGIN), f"non-ergonomic minus ergonomic {_text(pair, unit=' m')}")


def _random_start_finding(pairs: Mapping[str, Any]) -> Finding:
    """The random start raises the score of the non-ergonomic condition only."""
    claim = "A random start raises the score at the grasp of the non-ergonomic condition only"
    shown = [
        (_raised if condition == NON_ERGONOMIC else _unchanged)(pair, SCORE_MARGIN) for condition, pair in pairs.items()
    ]
    evidence = "; ".join(f"{condition} {_text(pair)}" for condition, pair in pairs.items())
    return Finding(claim, _all(shown), f"{evidence}; random minus rest, no effect within {SCORE_MARGIN:g} points")


def _raised(pair: Mapping[str, Any], margin: float, sign: int = 1) -> bool | None:
    """Whether the difference is positive: shown by its test; not so where its interval stays below the margin."""
    low, high = _interval(pair, sign)
    if pair["p_holm"] is not None and pair["p_holm"] < ALPHA and sign * pair["difference"] > 0:
        return True
    return False if high is not None and high < margin and low is not None else None


def _unchanged(pair: Mapping[str, Any], margin: float) -> bool | None:
    """Whether there is no difference of note: shown by an interval inside the margin, refuted by one outside."""
    low, high = _interval(pair)
    if low is None or high is None:
        return None
    if equivalent(low, high, margin):
        return True
    return False if low > 0 or high < 0 else None


def _interval(pair: Mapping[str, Any], sign: int = 1) -> tuple[float | None, float | None]:
    """The 95 % interval of a difference; none of too few runs, of which more are needed where all are equal.

    Equal differences have no dispersion to judge by.
    """
    low, high = pair["low"], pair["high"]
    fewest = FEWEST_EQUAL if pair["ties"] == pair["n"] else FEWEST_PAIRS
    if low is None or high is None or pair["n"] < fewest:
        return None, None
    return (low, high) if sign > 0 else (-high, -low)


def _text(pair: Mapping[str, Any], sign: int = 1, unit: str = "") -> str:
    if pair["difference"] is None or pair["p_holm"] is None:
        return f"no test (n = {pair['n']})"
    low, high = (pair["low"], pair["high"]) if sign > 0 else (-pair["high"], -pair["low"])
    interval = f"95 % {signed(low)} to {signed(high)}, {p_text(pair['p_holm'])}, n = {pair['n']}"
    return f"{signed(sign * pair['difference'])}{unit} ({interval})"


def _all(shown: list[bool | None]) -> bool | None:
    return False if False in shown else None if None in shown else True
