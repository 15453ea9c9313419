"""What the paper found, and whether these runs show it too: sentences made from the tests alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from lgp.experiments import published

ALPHA: Final = 0.05
"""Corrected p below which a difference counts."""


@dataclass(frozen=True)
class Finding:
    """A finding of the paper.

    Attributes:
        claim: what the paper found.
        shown: whether these runs show it; None where they cannot say.
        because: the numbers.
    """

    claim: str
    shown: bool | None
    because: str


def findings(summary: Mapping[str, Any]) -> list[Finding]:
    """Return the findings of the paper against a summary."""
    found = []
    for start, here in summary["starts"].items():
        found += [_order(start, here["reba_grasp"]), _choice(start, here), _height(start, here["chosen_height"])]
    if summary["between_starts"] is not None:
        found.append(_random(summary["between_starts"]["reba_grasp"]))
    return found


def _order(start: str, scores: Mapping[str, Any]) -> Finding:
    """The three means in the paper's order, and every step significant."""
    order = " < ".join(published.EXPECTED_ORDER)
    steps = {frozenset((pair["first"], pair["second"])): pair for pair in scores["pairs"]}
    said: list[str] = []
    shown: list[bool | None] = []
    for low, high in zip(published.EXPECTED_ORDER, published.EXPECTED_ORDER[1:], strict=False):
        pair = steps[frozenset((low, high))]
        if pair["p_holm"] is None or pair["difference"] is None:
            shown.append(None)
            said.append(f"{high} against {low}: no test (n = {pair['n']})")
            continue
        difference = pair["difference"] * (1 if pair["first"] == high else -1)
        shown.append(difference > 0 and pair["p_holm"] < ALPHA)
        said.append(f"{high} minus {low} {difference:+.2f} (p = {pair['p_holm']:.2g}, n = {pair['n']})")
    return Finding(f"{start} start: REBA at the grasp {order}", _all(shown), "; ".join(said) + ", t tests after Holm")


def _choice(start: str, here: Mapping[str, Any]) -> Finding:
    """Fewer choose the left table with the ergonomic cost, and more the one in the centre."""
    change, percent = here["table_change"], {name: part["percent"] for name, part in here["table_choice"].items()}
    claim = f"{start} start: with the ergonomic cost the choice moves from the left table to the centre"
    plain, ergonomic = percent["non-ergonomic"], percent["ergonomic"]
    if change["p"] is None or not change["n"]:
        return Finding(claim, None, f"no test (n = {change['n']})")
    moved = plain["left"] > ergonomic["left"] and plain["center"] < ergonomic["center"]
    said = ", ".join(f"{table} {plain[table]:.0f} to {ergonomic[table]:.0f} %" for table in ("left", "center", "right"))
    test = f"Stuart-Maxwell {change['statistic']:.1f}, df {change['df']}, p = {change['p']:.2g}, n = {change['n']}"
    return Finding(claim, moved and change["p"] < ALPHA, f"{said} ({test})")


def _height(start: str, heights: Mapping[str, Any]) -> Finding:
    """The chosen table is lower with the ergonomic cost."""
    pair = heights["pairs"][0]
    claim = f"{start} start: with the ergonomic cost the chosen table is lower"
    if pair["p_holm"] is None:
        return Finding(claim, None, f"no test (n = {pair['n']})")
    said = f"non-ergonomic minus ergonomic {pair['difference']:+.2f} m (p = {pair['p_holm']:.2g}, n = {pair['n']})"
    return Finding(claim, pair["difference"] > 0 and pair["p_holm"] < ALPHA, said)


def _random(pairs: Mapping[str, Any]) -> Finding:
    """The random start raises the score of the non-ergonomic condition, and of no other one."""
    claim = "A random start raises the score at the grasp of the non-ergonomic condition only"
    said: list[str] = []
    shown: list[bool | None] = []
    for condition, pair in pairs.items():
        if pair["p_holm"] is None or pair["difference"] is None:
            shown.append(None)
            said.append(f"{condition} no test (n = {pair['n']})")
            continue
        raised = pair["difference"] > 0 and pair["p_holm"] < ALPHA
        shown.append(raised == (condition == "non-ergonomic"))
        interval = "" if pair["low"] is None else f", 95 % {pair['low']:+.2f} to {pair['high']:+.2f}"
        said.append(f"{condition} {pair['difference']:+.2f} (p = {pair['p_holm']:.2g}{interval}, n = {pair['n']})")
    return Finding(claim, _all(shown), "; ".join(said) + ", random minus rest")


def _all(shown: list[bool | None]) -> bool | None:
    return False if False in shown else None if None in shown else True
