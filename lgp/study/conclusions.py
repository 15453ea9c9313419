"""Conclusions of a study as sentences: the primary test, the parts of the body, and disagreement between tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from lgp.statistics.formatting import p_text, signed
from lgp.study.scoring import PARTS, TOTAL

ALPHA: Final = 0.05
"""Significance level of a corrected p value."""


def conclusion(results: Mapping[str, Any], conditions: list[str]) -> str:
    """One sentence on the mean REBA score, the primary measure, from the results of `analyse` with None for NaN."""
    total = results[TOTAL]
    if len(conditions) < 2:
        return f"There is only one condition, {conditions[0]}: scores without a comparison."
    if len(conditions) == 2:
        return _pair_conclusion(total["pairs"][0])
    anova = total["anova"]
    if anova["p_corrected"] is None:
        return f"No test can be made: {_participants(anova['n'])} with all of {', '.join(conditions)}."
    epsilon = anova["epsilon"] or 1.0
    ratio = f"F({anova['df'] * epsilon:.1f}, {anova['df_error'] * epsilon:.1f}) = {anova['f']:.2f}"
    test = f"(repeated-measures ANOVA, {_participants(anova['n'])}, {ratio}, {p_text(anova['p_corrected'])})"
    if anova["p_corrected"] >= ALPHA:
        return f"No difference in mean REBA between the {len(conditions)} conditions is shown {test}."
    significant = [_order(pair) for pair in total["pairs"] if _significant(pair["p_holm"])]
    which = f"; after Holm {', '.join(significant)}" if significant else "; no single pair is significant after Holm"
    return f"The mean REBA score differs between the {len(conditions)} conditions {test}{which}."


def _pair_conclusion(pair: Mapping[str, Any]) -> str:
    n, difference = pair["n"], pair["difference"]
    if n < 2:
        return (
            f"No test can be made: {_participants(n)} with both {pair['first']} and {pair['second']}; two are needed."
        )
    if pair["ties"] == n:
        return f"The mean REBA score is the same with {pair['first']} and {pair['second']} for all {n} participants."
    if pair["p"] is None:
        return f"The difference is {difference:+.2f} for each of {n} participants: no test with zero variance."
    word = "lower" if difference < 0 else "higher"
    numbers = (
        f"{abs(difference):.2f} {word} with {pair['first']} than with {pair['second']} (95 % interval of the "
        f"difference {signed(pair['low'])} to {signed(pair['high'])}; {pair[word]} of {n} participants; paired t test "
        f"{p_text(pair['p'])}, g = {signed(pair['g'])})"
    )
    if pair["p"] < ALPHA:
        return f"The mean REBA score is {numbers}."
    return f"No difference is shown: the mean REBA score is {numbers}."


def parts_conclusion(results: Mapping[str, Any]) -> str:
    """Parts of the body that differ after the correction, those that do not, and those without any difference."""
    significant, others, constant = [], [], []
    for name, title in PARTS.items():
        part = results["parts"][name]
        title = title.split(" (")[0].lower()
        pairs = [pair for pair in part["pairs"] if _significant(pair["p_holm"])]
        if part["constant"]:
            constant.append(title)
        elif pairs:
            significant.append(f"{title} ({', '.join(_order(pair) for pair in pairs)})")
        else:
            others.append(title)
    clauses = [f"Parts that differ after Holm: {', '.join(significant) or 'none'}"]
    clauses += [f"not shown: {', '.join(others)}"] if others else []
    clauses += [f"without any difference and not tested: {', '.join(constant)}"] if constant else []
    return "; ".join(clauses) + "."


def disagreements(results: Mapping[str, Any]) -> list[str]:
    """Warnings on pairs where t test and signed-rank test differ, or differences are not normal."""
    warnings = []
    for pair in results[TOTAL]["pairs"]:
        by_t, by_rank = pair["p_holm"], pair["wilcoxon_p_holm"]
        if by_t is not None and by_rank is not None and (by_t < ALPHA) != (by_rank < ALPHA):
            warnings.append(
                f"{pair['first']} against {pair['second']}: the t test ({p_text(by_t)}) and the signed-rank test "
                f"({p_text(by_rank)}) disagree; take the difference as not shown"
            )
        normality = pair["normality"]["p"]
        if normality is not None and normality < ALPHA:
            warnings.append(
                f"{pair['first']} against {pair['second']}: the differences are not normal (Shapiro-Wilk "
                f"{p_text(normality)}); the signed-rank test, which does not assume this, gives {p_text(by_rank)}"
            )
    return warnings


def _significant(p: float | None) -> bool:
    return p is not None and p < ALPHA


def _order(pair: Mapping[str, Any]) -> str:
    return f"{pair['first']} {'below' if pair['difference'] < 0 else 'above'} {pair['second']}"


def _participants(n: int) -> str:
    return f"{n} participant{'' if n == 1 else 's'}"
