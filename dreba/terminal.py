"""What the `dreba` commands print for people: tables in the terminal, nothing computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from dreba.evaluate import PUBLISHED, PUBLISHED_OVERALL, Evaluation


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


def show_comparison(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print RMSE per class of several models, then how long they take.

    Args:
        rows: of `dreba compare --json`, each with "model", "classes", "overall", "seconds_per_pose".
    """
    scores = sorted({int(score) for row in rows for score in row["classes"]} | set(PUBLISHED))
    table = Table(title="RMSE per REBA class", title_justify="left", header_style="bold")
    table.add_column("model")
    for heading in (*map(str, scores), "all", "rank", "rounded", "1 pose [us]", "batch [us]"):
        table.add_column(heading, justify="right")
    table.add_row("published, Table I", *map(_published, scores), f"{PUBLISHED_OVERALL:.2f}", *["-"] * 4)
    for row in rows:
        errors = [row["classes"].get(str(score)) for score in scores]
        overall, seconds = row["overall"], row["seconds_per_pose"]
        table.add_row(
            row["model"],
            *("-" if error is None else f"{error['rmse']:.2f}" for error in errors),
            f"{overall['rmse']:.2f}",
            "-" if overall["spearman"] is None else f"{overall['spearman']:.3f}",
            f"{overall['rounded_accuracy']:.0%}",
            f"{1e6 * seconds['single']:.0f}",
            f"{1e6 * seconds['batch']:.2f}",
        )
    console.print(table)


def show_enabler(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print what optimising each model leads to.

    Args:
        rows: of `dreba.comparison.enable`.
    """
    title = "true REBA reached when the model is minimised on reach tasks (infeasible counts 12)"
    table = Table(title=title, title_justify="left", header_style="bold")
    for heading in ("model", "start"):
        table.add_column(heading)
    for heading in ("mean REBA", "= best known", "best of starts", "infeasible", "evaluations", "ms"):
        table.add_column(heading, justify="right")
    for row in rows:
        shares = (f"{row[key]:.0%}" for key in ("share_best", "share_best_of_starts", "infeasible"))
        figures = (f"{row['evaluations']:.0f}", f"{1e3 * row['seconds']:.0f}")
        table.add_row(row["model"], row["start"], f"{row['mean_reba']:.2f}", *shares, *figures)
    console.print(table)


def _published(score: int) -> str:
    return f"{PUBLISHED[score]:.2f}" if score in PUBLISHED else "-"
