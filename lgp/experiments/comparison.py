"""The paper beside all variants of its experiments: one table, made from the summaries in their folders."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from lgp.errors import LgpError
from lgp.experiments import published
from lgp.experiments.runs import CONDITIONS, STARTS, TABLES
from lgp.experiments.summary import write_summary
from lgp.experiments.toolbox_orders import GRASP_FIRST, ORDERS, PLACE_FIRST
from lgp.files import REPORT, SUMMARY
from lgp.statistics.formatting import number, p_value
from reba.files import from_json, plain_data, write_folder, write_text
from reba.open_file import read_settings
from reba.provenance import with_provenance
from reba.report.page import template

FORMAT: Final = "lgp-experiment-comparison"
DASH: Final = "–"


def comparison(folder: str | Path, names: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return the tables of all results that are finished, as plain data.

    Args:
        folder: with the folders of each experiment, and in these a folder for each of its variants.
        names: experiment -> its variants.

    Raises:
        LgpError: a summary is damaged.
    """
    stored = {
        experiment: {
            name: summary for name in variants if (summary := _summary(Path(folder) / experiment / name)) is not None
        }
        for experiment, variants in names.items()
    }
    starts = {}
    for start in STARTS:
        have = {name: one["starts"][start] for name, one in stored["screwdriver"].items() if start in one["starts"]}
        if have:
            starts[start] = {"variants": list(have), "rows": screwdriver_rows(have, start)}
    compared = {
        "format": FORMAT,
        "published": published.SOURCE,
        "screwdriver": starts,
        "toolbox": [row for name, one in stored["toolbox"].items() for row in toolbox_rows(name, one)],
    }
    plain: dict[str, Any] = plain_data(with_provenance(compared))
    return plain


def write_comparison(
    folder: str | Path, compared: Mapping[str, Any], titles: Mapping[str, str], command: str = ""
) -> None:
    """Write `report.html` and `summary.json` of a comparison into a folder.

    Args:
        compared: from `comparison`.
        titles: variant -> what it is, in one line.
        command: command line that reproduces the results, shown on the page.

    Raises:
        RebaError: a file cannot be written.
    """
    html = template("lgp.experiments", "comparison.html", {"number": number, "together": _together}).render(
        **{name: compared[name] for name in ("published", "screwdriver", "toolbox")},
        orders=ORDERS,
        titles=titles,
        command=command,
    )

    def write(part: Path) -> None:
        write_text(part / REPORT, html)
        write_summary(part / SUMMARY, compared)

    write_folder(folder, write, last=SUMMARY)


def _summary(folder: Path) -> dict[str, Any] | None:
    file = folder / SUMMARY
    if not file.exists():
        return None
    try:
        stored = from_json(read_settings(file))
    except (OSError, ValueError, RecursionError) as error:
        raise LgpError(f"{file}: cannot be read ({error}); delete the folder and repeat the command") from error
    if not isinstance(stored, dict):
        raise LgpError(f"{file}: expected a JSON object; delete the folder and repeat the command")
    return stored


def screwdriver_rows(variants: Mapping[str, Mapping[str, Any]], start: str) -> list[dict[str, Any]]:
    """Return rows with a text for the paper and for each variant, whose results of one initial posture are given."""
    rows: list[dict[str, Any]] = []

    def add(result: str, paper: str, values: Mapping[str, str]) -> None:
        rows.append({"result": result, "paper": paper, "variants": dict(values)})

    add("runs", "100", {name: str(one["runs"]) for name, one in variants.items()})
    for condition in CONDITIONS[:2]:
        theirs = published.CHOICE_PERCENT[start].get(condition)
        choices = {name: one["table_choice"][condition] for name, one in variants.items()}
        add(
            f"tables, {condition}",
            DASH if theirs is None else _shares(theirs),
            {name: _shares(one["percent"]) for name, one in choices.items()},
        )
        add(
            f"tables, {condition}, minus the paper's",
            "",
            {name: _against(one["against_published"]) for name, one in choices.items()},
        )
    for condition in CONDITIONS[:2]:
        height = published.CHOSEN_HEIGHT[start].get(condition)
        chosen = {name: one["chosen_height"]["conditions"][condition] for name, one in variants.items()}
        add(
            f"height, {condition}",
            DASH if height is None else f"{height[0]:.2f} ± {height[1]:.2f}",
            {name: _mean(one, "sd") for name, one in chosen.items()},
        )
        if height is not None:
            against = {name: _difference(one["against_published"], "p") for name, one in chosen.items()}
            add(f"height, {condition}, minus the paper's", "", against)
    heights = {name: one["chosen_height"]["pairs"] for name, one in variants.items()}
    add("height, non-ergonomic − ergonomic", DASH, {name: _difference(pairs[0]) for name, pairs in heights.items()})
    for condition in CONDITIONS:
        values = {name: _mean(one["reba_grasp"]["conditions"][condition], "se") for name, one in variants.items()}
        add(f"REBA at the grasp, {condition}", DASH, values)
    for number_of_pair, pair in enumerate(next(iter(variants.values()))["reba_grasp"]["pairs"]):
        add(
            f"REBA at the grasp, {pair['first']} − {pair['second']}",
            DASH,
            {name: _difference(one["reba_grasp"]["pairs"][number_of_pair]) for name, one in variants.items()},
        )
    add(
        "order of REBA at the grasp",
        " < ".join(published.EXPECTED_ORDER),
        {name: " < ".join(one["reba_grasp"]["order"]) for name, one in variants.items()},
    )
    add(
        "infeasible, of all conditions",
        DASH,
        {name: str(sum(part["n"] for part in one["infeasible"].values())) for name, one in variants.items()},
    )
    add(
        "plans in which the audit found a fault",
        DASH,
        {
            name: " / ".join(f"{part['with_fault']} of {part['plans']}" for part in one["audit"].values())
            for name, one in variants.items()
        },
    )
    return rows


def toolbox_rows(variant: str, summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a row for each condition: its order beside the paper's, costs of both orders, mass from which on."""
    rows = []
    for (name, one), expected in zip(summary["conditions"].items(), (GRASP_FIRST, PLACE_FIRST), strict=True):
        orders = one["orders"]
        costs = {order: orders[order]["total"] if order in orders else None for order in ORDERS}
        loads = {order: orders[order]["load"] if order in orders else 0.0 for order in ORDERS}
        rows.append({
            "variant": variant, "condition": name, "order": one["order"], "published": expected, "costs": costs,
            "without_load": {order: None if cost is None else cost - loads[order] for order, cost in costs.items()},
            "mass": one["first_part"]["mass_for_place_first"], "reba": one["reba"]["mean"],
        })  # fmt: skip
    return rows


def _together(words: str) -> str:
    """Return a text in which no line ends within a figure, but after commas and around intervals.

    >>> _together("2 (-7 to 11) / 3 (0 to 5), p = 0.1").replace("\\xa0", "_")
    '2 (-7_to_11)_/ 3 (0_to_5), p_=_0.1'
    """
    return re.sub(r"(?<![/,]) (?!\()", "\N{NO-BREAK SPACE}", words) if re.search(r"\d", words) else words


def _shares(percent: Mapping[str, float | None]) -> str:
    return " / ".join(number(percent[table], 0) for table in TABLES)


def _mean(one: Mapping[str, Any], spread: str) -> str:
    return f"{number(one['mean'])} ± {number(one[spread])}"


def _difference(pair: Mapping[str, Any], p: str = "p_holm") -> str:
    if pair["low"] is None:
        return number(pair["difference"])
    interval = f"{number(pair['low'])} to {number(pair['high'])}"
    return f"{number(pair['difference'])} ({interval}), p = {p_value(pair[p])}"


def _against(tested: Mapping[str, Any] | None) -> str:
    """Return the differences of shares to the paper's [percentage points] with their intervals, and p of all."""
    if tested is None:
        return DASH
    points = (
        "{} ({} to {})".format(*(number(100.0 * one[key], 0) for key in ("difference", "low", "high")))
        for one in tested["shares"].values()
    )
    return f"{' / '.join(points)}, p = {p_value(tested['p'])}"
