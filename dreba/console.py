"""Terminal tables of the `dreba` commands: evaluation, comparison and reach tasks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from dreba.surrogates.base import Surrogate
from dreba.surrogates.metrics import (
    PUBLISHED,
    PUBLISHED_OVERALL,
    Evaluation,
    distance_to_published,
    published_overall,
    with_error,
)
from reba.terminal import Console, Text


def show_evaluation(console: Console, name: str, evaluation: Evaluation, model: Surrogate) -> None:
    """Print the error per REBA class beside that of Table I, and the setting of the model."""
    table = Table(title=f"{name} ({evaluation.kind})", title_justify="left", header_style="bold")
    for heading in ("REBA", "poses", "RMSE", "bias", "RMSE of Table I"):
        table.add_column(heading, justify="right")
    for score, error in evaluation.classes.items():
        table.add_row(str(score), f"{error.n:,}", f"{error.rmse:.2f}", f"{error.bias:+.2f}", _published(score))
    published = f"{published_overall(evaluation.classes):.2f}"
    table.add_row("all", f"{evaluation.n:,}", f"{evaluation.rmse:.2f}", "", published, style="bold")
    console.print(table)
    console.print(Text(f"setting: {model.setting}; factors known: {', '.join(model.factors_) or 'none'}"))
    if set(PUBLISHED) <= set(evaluation.classes):
        console.print(f"root mean square difference to Table I {distance_to_published(evaluation):.2f}")
    console.print(
        f"mean over classes {evaluation.balanced_rmse:.2f}; rank correlation {evaluation.spearman:.3f}; "
        f"rounded value correct in {100 * evaluation.rounded_accuracy:.1f} %"
    )


def show_comparison(console: Console, rows: Sequence[Mapping[str, Any]], domain: str) -> None:
    """Print the rows of `dreba.compare`: RMSE per class, rank correlation and time per pose, one column a model."""
    scores = sorted({int(score) for row in rows for score in row["classes"]} | set(PUBLISHED))
    # Classes as columns would not fit a terminal of 80 characters.
    title = f"RMSE per REBA class, domain {domain}, beside the published Table I"
    table = Table(title=title, title_justify="left", header_style="bold", box=SIMPLE_HEAD)
    table.add_column("REBA", no_wrap=True)
    for heading in ("Table I", *(row["model"] for row in rows)):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for score in scores:
        errors = [row["classes"].get(str(score)) for row in rows]
        cells = ["-" if error is None else f"{error['rmse']:.2f}" for error in errors]
        table.add_row(str(score), _published(score), *cells)
    figures = {
        "all": [f"{row['overall']['rmse']:.2f}" for row in rows],
        "rank": ["-" if row["overall"]["spearman"] is None else f"{row['overall']['spearman']:.3f}" for row in rows],
        "rounded": [f"{100 * row['overall']['rounded_accuracy']:.0f} %" for row in rows],
        "1 pose [us]": [f"{1e6 * row['seconds_per_pose']['single']:.0f}" for row in rows],
        "batch [us]": [f"{1e6 * row['seconds_per_pose']['batch']:.2f}" for row in rows],
    }
    for name, cells in figures.items():
        table.add_row(name, f"{PUBLISHED_OVERALL:.2f}" if name == "all" else "-", *cells)
    console.print(table)


def show_enabler(console: Console, enabler: Mapping[str, Any]) -> None:
    """Print the true REBA reached on reach tasks by minimising each model, the result of `usefulness.enable`."""
    known = enabler["certified"]
    title = (
        f"true REBA reached by minimisation on {enabler['tasks']} reach tasks, {enabler['space']} "
        f"(out of reach counts 12)"
    )
    table = Table(title=title, title_justify="left", header_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("minimised", overflow="fold")
    table.add_column("start", no_wrap=True)
    for heading in ("mean\nREBA", "less the\ndistance", "infea-\nsible", "evalu-\nations", "ms"):
        table.add_column(Text(heading, keep="\n"), justify="right", no_wrap=True)
    for row in enabler["rows"]:
        table.add_row(
            row["name"], row["start"], with_error(row["reba"], row["standard_error"]),
            with_error(row["difference"], row["difference_standard_error"], "+"), f"{100 * row['infeasible']:.0f} %",
            f"{row['evaluations']:.0f}", f"{1e3 * row['seconds']:.0f}",
        )  # fmt: skip
    console.print(table)
    console.print(
        f"all rows: {enabler['solver']}; standard errors over tasks; least true REBA: {known['proved']:.2f} proved, "
        f"{known['reached']:.2f} reached, certified for {known['tasks']} of {enabler['tasks']} tasks"
    )
    if enabler["recommended"]:
        best = enabler["recommended"]
        console.print(
            Text(
                f"recommended here: {best['name']} (mean REBA {best['reba']:.2f} over both starts; fewest evaluations "
                f"of those within a standard error of the lowest)"
            )
        )


def _published(score: int) -> str:
    return f"{PUBLISHED[score]:.2f}" if score in PUBLISHED else "-"
