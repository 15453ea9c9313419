"""Results of the screwdriver experiment: `summary.json`, the figures as SVG, and the HTML report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgp.experiments import published
from lgp.experiments.figures import bars, example, profile, reach_map
from lgp.experiments.findings import findings
from lgp.experiments.pareto import pareto_figure
from lgp.experiments.runs import CONDITIONS, STARTS, TABLES, check_paths, check_runs
from lgp.experiments.summary import summarise, write_summary
from lgp.experiments.variants import Variant
from lgp.experiments.variations import values_of_weight
from lgp.experiments.weight_figure import weight_figure
from lgp.files import REPORT, SUMMARY
from lgp.kinematics.reachability import Reachability
from lgp.scene.model import Scene
from lgp.statistics.formatting import number, p_value
from lgp.statistics.paired_tests import stars
from lgp.svg import with_generator
from reba.files import write_folder, write_text
from reba.report.page import template

if TYPE_CHECKING:
    import pandas as pd

FRONT = "figure_pareto_"
"""First part of the names of the figures of Pareto fronts."""
FIGURE_NUMBER = {"rest": 5, "random": 6}
"""Initial posture -> number of the paper's figure."""


def write_results(
    folder: str | Path,
    runs: pd.DataFrame,
    paths: pd.DataFrame,
    scene: Scene,
    *,
    variant: Variant | None = None,
    settings: Mapping[str, Any] | None = None,
    command: str = "",
    reach: Reachability | None = None,
    sensitivity: Sequence[Mapping[str, Any]] | None = None,
    family: Mapping[str, Any] | None = None,
    fronts: Sequence[Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """Write `summary.json`, `figure_5.svg` to `figure_7.svg` and `report.html` into a folder; return the summary.

    Args:
        runs, paths: tables of `RunStore.finish`, of one initial posture or both.
        scene: the planned scene; its free choices are listed with their reasons.
        variant: of the experiment; its assumptions are listed.
        settings: of the experiment, shown and kept in the summary.
        command: command line that reproduces the results, shown on the page.
        reach: reachability of the table tops by each hand.
        sensitivity: rows of `lgp.experiments.sensitivity.sensitivity_table`.
        family: from `lgp.experiments.family_runs.family_summary`.
        fronts: from `lgp.experiments.pareto.pareto_fronts`.

    Raises:
        LgpError: a table has wrong columns or values, or statsmodels is not installed.
        RebaError: a file cannot be written.
    """
    summary = summarise(runs, paths, settings, sensitivity, family, fronts)
    plots = plots_of(summary, check_paths(paths))
    html = render(summary, runs, paths, scene, plots, variant=variant, command=command, reach=reach)

    def write(part: Path) -> None:
        for name, svg in plots.items():
            write_text(part / f"{name}.svg", with_generator(svg))
        write_text(part / REPORT, html)
        write_summary(part / SUMMARY, summary)

    write_folder(folder, write, last=SUMMARY)
    return summary


def plots_of(summary: Mapping[str, Any], paths: pd.DataFrame) -> dict[str, str]:
    """Figures that are written as files: name -> SVG."""
    plots = {
        f"figure_{FIGURE_NUMBER[start]}": bars(
            results["reba_grasp"], f"Bars: mean REBA score at the grasp per condition, {start} start"
        )
        for start, results in summary["starts"].items()
    }
    if len(paths):
        plots["figure_7"] = profile(paths, "Lines: mean REBA score over the phases per condition and start")
    drawn = {f"{FRONT}{one['name']}": pareto_figure(one) for one in summary["pareto"] or ()}
    return plots | {name: figure for name, figure in drawn.items() if figure}


def render(
    summary: Mapping[str, Any],
    runs: pd.DataFrame,
    paths: pd.DataFrame,
    scene: Scene,
    plots: Mapping[str, str],
    *,
    variant: Variant | None = None,
    command: str = "",
    reach: Reachability | None = None,
) -> str:
    """Report as HTML text; arguments as in `write_results`, `plots` from `plots_of`."""
    from markupsafe import Markup

    filters = {"p": p_value, "number": number, "stars": _stars}
    return template("lgp.experiments", "screwdriver.html", filters).render(
        summary=summary,
        findings=findings(summary),
        conditions=CONDITIONS,
        tables=TABLES,
        starts=[start for start in STARTS if start in summary["starts"]],
        missing=[start for start in STARTS if start not in summary["starts"]],
        table_number=published.TABLE_NUMBER,
        figure_number=FIGURE_NUMBER,
        plots={name: Markup(svg) for name, svg in plots.items()},
        example=example(check_runs(runs), check_paths(paths)),
        Markup=Markup,
        scene=scene,
        choices=scene.choices if variant is None else variant.left_open(scene),
        variant=variant,
        weight=Markup(weight_figure(summary["sensitivity"] or [], values_of_weight(scene))),
        reach=None if reach is None else _reach_rows(reach.shares()),
        map=None if reach is None else Markup(reach_map(scene, reach.data)),
        sensitivity=summary["sensitivity"] or [],
        family=summary["family"],
        fronts=summary["pareto"] or [],
        front_plots={name.removeprefix(FRONT): Markup(plot) for name, plot in plots.items() if name.startswith(FRONT)},
        command=command,
    )


def _stars(value: float | None) -> str:
    return "" if value is None else stars(value) or "n.s."


def _reach_rows(shares: pd.DataFrame) -> dict[str, Any]:
    """Table heights [m], and rows of hand, table and the reached share at each height."""
    rows: Sequence[tuple[Any, Any]] = list(shares.iterrows())
    return {
        "heights": [float(height) for height in shares.columns],
        "rows": [
            {"hand": hand, "table": table, "shares": [None if share != share else float(share) for share in row]}
            for (hand, table), row in rows
        ],
    }
