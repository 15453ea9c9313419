"""What a study found, in a sentence each: the decision, the parts behind it, and whether the tests agree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from lgp.statistics.formatting import p_text, signed
from lgp.study.scoring import PARTS, TOTAL

ALPHA: Final = 0.05


def verdict(found: Mapping[str, Any], conditions: list[str]) -> str:
    """Return the decision on the mean REBA score in one sentence.

    Args:
        found: plain data that `analyse` returned, None where there is no number.
        conditions: in their order.
    """
    total = found[TOTAL]
    if len(conditions) < 2:
        return f"There is only one condition, {conditions[0]}: its scores are here, nothing can be compared."
    if len(conditions) == 2:
        return _two(total["pairs"][0])
    one = total["anova"]
    if one["p_corrected"] is None:
        return f"No test can be made: {_people(one['n'])} with all of {', '.join(conditions)}."
    shrunk = one["epsilon"] or 1.0
    said = f"F({one['df'] * shrunk:.1f}, {one['df_error'] * shrunk:.1f}) = {one['f']:.2f}"
    test = f"(repeated-measures ANOVA, {_people(one['n'])}, {said}, {p_text(one['p_corrected'])})"
    if one["p_corrected"] >= ALPHA:
        return f"No difference in mean REBA between the {len(conditions)} conditions is shown {test}."
    clear = [_order(pair) for pair in total["pairs"] if _shown(pair["p_holm"])]
    which = f"; after Holm {', '.join(clear)}" if clear else "; no single pair stands out after Holm"
    return f"The mean REBA score differs between the {len(conditions)} conditions {test}{which}."


def _two(pair: Mapping[str, Any]) -> str:
    n, gap = pair["n"], pair["difference"]
    if n < 2:
        return f"No test can be made: {_people(n)} with both {pair['first']} and {pair['second']}, two are needed."
    if pair["ties"] == n:
        return f"The mean REBA score is the same with {pair['first']} and {pair['second']} for all {n} participants."
    if pair["p"] is None:
        return f"The difference is {gap:+.2f} for each of {n} participants: without any spread no test can be made."
    word = "lower" if gap < 0 else "higher"
    numbers = (
        f"{abs(gap):.2f} {word} with {pair['first']} than with {pair['second']} (95 % interval of the difference "
        f"{signed(pair['low'])} to {signed(pair['high'])}; {pair[word]} of {n} participants; paired t test "
        f"{p_text(pair['p'])}, g = {signed(pair['g'])})"
    )
    if pair["p"] < ALPHA:
        return f"The mean REBA score is {numbers}."
    return f"No difference is shown: the mean REBA score is {numbers}."


def parts_sentence(found: Mapping[str, Any]) -> str:
    """Return which parts differ after the correction, which do not, and which were not tested."""
    clear, rest, same = [], [], []
    for name, title in PARTS.items():
        one = found["parts"][name]
        title = title.split(" (")[0].lower()
        shown = [pair for pair in one["pairs"] if _shown(pair["p_holm"])]
        if one["constant"]:
            same.append(title)
        elif shown:
            clear.append(f"{title} ({', '.join(_order(pair) for pair in shown)})")
        else:
            rest.append(title)
    said = [f"Parts that differ after Holm: {', '.join(clear) or 'none'}"]
    said += [f"not shown: {', '.join(rest)}"] if rest else []
    said += [f"without any difference and not tested: {', '.join(same)}"] if same else []
    return "; ".join(said) + "."


def agreement(found: Mapping[str, Any]) -> list[str]:
    """Return where the t test and the signed ranks decide differently, which a reader must weigh."""
    said = []
    for pair in found[TOTAL]["pairs"]:
        by_t, by_rank = pair["p_holm"], pair["wilcoxon_p_holm"]
        if by_t is not None and by_rank is not None and (by_t < ALPHA) != (by_rank < ALPHA):
            said.append(
                f"{pair['first']} against {pair['second']}: the t test ({p_text(by_t)}) and the signed ranks "
                f"({p_text(by_rank)}) decide differently; take the difference as not shown"
            )
        shape = pair["normality"]["p"]
        if shape is not None and shape < ALPHA:
            said.append(
                f"{pair['first']} against {pair['second']}: the differences are not normal (Shapiro-Wilk "
                f"{p_text(shape)}); the signed ranks, which do not need that, give {p_text(by_rank)}"
            )
    return said


def _shown(p: float | None) -> bool:
    return p is not None and p < ALPHA


def _order(pair: Mapping[str, Any]) -> str:
    return f"{pair['first']} {'below' if pair['difference'] < 0 else 'above'} {pair['second']}"


def _people(n: int) -> str:
    return f"{n} participant{'' if n == 1 else 's'}"
