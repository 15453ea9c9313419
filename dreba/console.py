"""What the `dreba` commands print for people: tables in the terminal, nothing computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from dreba.surrogates.metrics import PUBLISHED, PUBLISHED_OVERALL, Evaluation


def show_evaluation(console: Console, name: str, found: Evaluation) -> None:
    """Print error per REBA class beside the published one."""
    table = Table(title=f"{name} ({found.kind})", title_justify="left", header_style="bold")
    for heading in ("REBA", "poses", "RMSE", "bias", "RMSE of Table I"):
        table.add_column(heading, justify="right")
    for score, error in found.classes.items():
        table.add_row(str(score), f"{error.n:,}", f"{error.rmse:.2f}", f"{error.bias:+.2f}", _published(score))
    table.add_row("all", f"{found.n:,}", f"{found.rmse:.2f}", "", f"{PUBLISHED_OVERALL:.2f}", style="bold")
    console.print(table)
    console.print(
        f"mean over classes {found.balanced_rmse:.2f}; rank correlation {found.spearman:.3f}; "
        f"rounded value right in {found.rounded_accuracy:.1%}"
    )


def show_comparison(console: Console, rows: Sequence[Mapping[str, Any]], domain: str) -> None:
    """Print RMSE per class of several models, then how long they take.

    Args:
        rows: of `dreba compare --json`, each with "model", "classes", "overall", "seconds_per_pose".
        domain: name of the domain of the poses.
    """
    scores = sorted({int(score) for row in rows for score in row["classes"]} | set(PUBLISHED))
    # One column a model: classes as columns would not fit a terminal of 80 characters.
    title = f"RMSE per REBA class, domain {domain}, beside the published Table I"
    table = Table(title=title, title_justify="left", header_style="bold", box=SIMPLE_HEAD)
    table.add_column("REBA", no_wrap=True)
    for heading in ("Table I", *(row["model"] for row in rows)):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for score in scores:
        errors = [row["classes"].get(str(score)) for row in rows]
        found = ("-" if error is None else f"{error['rmse']:.2f}" for error in errors)
        table.add_row(str(score), _published(score), *found)
    figures = {
        "all": [f"{row['overall']['rmse']:.2f}" for row in rows],
        "rank": ["-" if row["overall"]["spearman"] is None else f"{row['overall']['spearman']:.3f}" for row in rows],
        "rounded": [f"{row['overall']['rounded_accuracy']:.0%}" for row in rows],
        "1 pose [us]": [f"{1e6 * row['seconds_per_pose']['single']:.0f}" for row in rows],
        "batch [us]": [f"{1e6 * row['seconds_per_pose']['batch']:.2f}" for row in rows],
    }
    for name, cells in figures.items():
        table.add_row(name, f"{PUBLISHED_OVERALL:.2f}" if name == "all" else "-", *cells)
    console.print(table)


def show_enabler(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print what optimising each model leads to.

    Args:
        rows: of `dreba.evaluation.evaluate.enable`.
    """
    title = "true REBA reached when the model is minimised on reach tasks (infeasible counts 12)"
    table = Table(title=title, title_justify="left", header_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("model", overflow="fold")
    table.add_column("start", no_wrap=True)
    for heading in ("mean\nREBA", "= best\nknown", "best of\nstarts", "infea-\nsible", "evalu-\nations", "ms"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        shares = (f"{row[key]:.0%}" for key in ("share_best", "share_best_of_starts", "infeasible"))
        figures = (f"{row['evaluations']:.0f}", f"{1e3 * row['seconds']:.0f}")
        table.add_row(row["model"], row["start"], f"{row['mean_reba']:.2f}", *shares, *figures)
    console.print(table)


def _published(score: int) -> str:
    return f"{PUBLISHED[score]:.2f}" if score in PUBLISHED else "-"
