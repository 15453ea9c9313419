"""Model report: error per class, values, weights, sweeps and worst poses in one self-contained HTML file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dreba.domain import Bins, Domain, domain_of
from dreba.errors import ModelError
from dreba.evaluation.evaluate import MODEL, POSES, values_on
from dreba.sampling.classes import true_scores
from dreba.sampling.poses import Poses
from dreba.surrogates.base import Surrogate
from dreba.surrogates.metrics import PUBLISHED, Evaluation, distance_to_published, evaluation_of, published_overall
from dreba.surrogates.quadratic import QuadraticModel
from reba.arrays import Array
from reba.checks import PATH, TEXT, accepts
from reba.files import write_atomic, write_text
from reba.outputs import FileOutput, check_outputs
from reba.posture.columns import ANGLES, COLUMNS, INDEX
from reba.posture.skeleton import stick_figure
from reba.printable import as_script_data
from reba.report.labels import angle_name
from reba.report.page import read, template

WORST_POSES: Final = 6
"""Number of poses shown, those with the largest absolute errors."""


@accepts(ModelError, model=MODEL, poses=POSES, path=PATH, name=TEXT, command=TEXT)
def write_report(
    model: Surrogate,
    poses: Poses,
    path: str | Path,
    *,
    name: str = "",
    command: str = "",
    temperature: float | None = None,
) -> None:
    """Write the report of a model on poses with their true scores as a self-contained HTML file.

    Args:
        model: fitted.
        poses: evaluation poses, held out from the fit.
        path: HTML file to write.
        name: title; the kind of the model by default.
        command: command line that reproduces the report.
        temperature: [deg] of models with temperatures; None for their default.

    Raises:
        ModelError: the model and the poses do not fit each other.
        reba.RebaError: the file cannot be written.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import dreba
        >>> with TemporaryDirectory() as folder:
        ...     path = Path(folder) / "quadratic.html"
        ...     write_report(dreba.load("quadratic"), dreba.sample(200, rng=1), path)
        ...     "Error per REBA class" in path.read_text(encoding="utf-8")
        True
    """
    check_outputs(FileOutput(path))
    html = render(model, poses, name=name, command=command, temperature=temperature)
    write_atomic(path, lambda part: write_text(part, html))


def render(
    model: Surrogate, poses: Poses, *, name: str = "", command: str = "", temperature: float | None = None
) -> str:
    """Return the report as HTML; arguments as in `write_report`."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    values = values_on(model, poses, temperature)
    evaluation = evaluation_of(model.kind, values, poses.reba)
    domain = _domain(model)
    plots = {
        "errors": [error_figure(evaluation)],
        "values": [value_figure(values, poses.reba)],
        "sweeps": sweep_figures(model, domain, temperature),
    }
    if isinstance(model, QuadraticModel):
        plots["weights"] = [weight_figure(model, domain)]
        if not model.free:
            plots["polynomials"] = polynomial_figures(model, domain)
    return template("dreba", "report.html", scripts=(get_plotlyjs(), read("dreba", "report.js"))).render(
        name=name or model.kind,
        model=model,
        evaluation=evaluation,
        published=PUBLISHED,
        published_overall=published_overall(evaluation.classes),
        distance=distance_to_published(evaluation) if set(PUBLISHED) <= set(evaluation.classes) else None,
        domain=domain,
        options=[(key, str(value)) for key, value in model.get_params(deep=False).items()],
        provenance=[(key, v if isinstance(v, str) else json.dumps(v)) for key, v in model.about_.provenance.items()],
        worst=_worst(values, poses),
        plots={
            key: [Markup(as_script_data(figure.to_json(validate=False))) for figure in figures]
            for key, figures in plots.items()
        },
        command=command,
        temperature=temperature,
    )


def _domain(model: Surrogate) -> Domain:
    """Return the domain a model was fitted in, "human" if the model does not name one."""
    return Domain.from_dict(model.about_.domain) if model.about_.domain else domain_of("human")


def _worst(values: np.ndarray, poses: Poses) -> list[dict[str, Any]]:
    """Return the poses with the largest absolute errors, each with a stick figure and its eight largest angles."""
    from markupsafe import Markup

    error = values - poses.reba
    worst = []
    for row in np.argsort(-np.abs(error))[:WORST_POSES]:
        angles = poses.angles[row]
        largest = np.argsort(-np.abs(angles))[:8]
        worst.append(
            {
                "true": int(poses.reba[row]),
                "value": float(values[row]),
                "error": float(error[row]),
                "angles": ", ".join(f"{angle_name(COLUMNS[i])} {angles[i]:.0f}°" for i in largest),
                "figure": Markup(stick_figure(angles, {}, f"pose with true REBA {poses.reba[row]}")),
            }
        )
    return worst


MODEL_COLOUR: Final = "#403a82"
TRUE: Final = "#1b2430"
PAPER: Final = "#c98a1b"
POINTS: Final = 181
"""Points of a curve over the range of an angle: steps of at most 2 deg over 360 deg."""
TICK_STEPS: Final = (5, 10, 20, 30, 60, 90)
"""[deg] Distances of ticks; a small plot, 160 px wide, has room for three or four ticks."""


def error_figure(evaluation: Evaluation) -> Any:
    """Return bars of RMSE per REBA class beside those of Table I, and a line of the bias."""
    import plotly.graph_objects as go

    scores = list(evaluation.classes)
    figure = go.Figure()
    figure.add_bar(
        x=scores, y=[error.rmse for error in evaluation.classes.values()], name="RMSE", marker_color=MODEL_COLOUR
    )
    figure.add_bar(x=list(PUBLISHED), y=list(PUBLISHED.values()), name="RMSE, Table I", marker_color=PAPER)
    bias = [error.bias for error in evaluation.classes.values()]
    figure.add_scatter(x=scores, y=bias, name="bias", mode="lines+markers", line={"color": TRUE, "width": 1.5})
    figure.update_layout(**_layout(340), xaxis={"title": "true REBA", "dtick": 1}, yaxis_title="error")
    return figure


def value_figure(values: Array, scores: NDArray[np.integer]) -> Any:
    """Return box plots of model values (n,) for every true score (5, 25, 50, 75, 95 % quantiles), with the diagonal."""
    import plotly.graph_objects as go

    figure = go.Figure()
    for score in np.unique(scores):
        low, q1, median, q3, high = np.quantile(values[scores == score], [0.05, 0.25, 0.5, 0.75, 0.95])
        figure.add_box(
            x=[int(score)], lowerfence=[low], q1=[q1], median=[median], q3=[q3], upperfence=[high],
            marker_color=MODEL_COLOUR, showlegend=False, name=str(int(score)),
        )  # fmt: skip
    ends = [int(scores.min()), int(scores.max())]
    figure.add_scatter(x=ends, y=ends, mode="lines", name="exact", line={"color": TRUE, "dash": "dot"})
    figure.update_layout(**_layout(380), xaxis={"title": "true REBA", "dtick": 1}, yaxis_title="value of the model")
    return figure


def polynomial_figures(model: QuadraticModel, domain: Domain) -> list[Any]:
    """Return each polynomial Q_i over the step table it was fitted to, as in Fig. 2 of Busch et al. (2018)."""
    curves = []
    for name, column in _angles(domain):
        if column not in model.joints_:
            continue
        bins = domain.bins_of(column)
        angle = np.linspace(bins.edges[0], bins.edges[-1], POINTS)
        c0, c1, c2 = model.polynomials_[model.joints_.index(column)]
        curves.append((name, angle, c0 + angle * (c1 + c2 * angle), _steps(bins)))
    return _small_plots(curves, "points")


def sweep_figures(model: Surrogate, domain: Domain, temperature: float | None) -> list[Any]:
    """Return a figure for each angle: the model's value and the true score over its limits, all others at rest."""
    curves = []
    rest = np.array([angle.best for angle in ANGLES for _ in angle.columns])
    for name, column in _angles(domain):
        bins = domain.bins_of(column)
        angle = np.linspace(bins.edges[0], bins.edges[-1], POINTS)
        poses = np.repeat(rest[None], POINTS, axis=0)
        poses[:, INDEX[column]] = angle
        values = model.value(poses[:, [INDEX[joint] for joint in model.joints_]], temperature=temperature)
        curves.append((name, angle, values, (angle, true_scores(domain, poses, None).astype(float))))
    return _small_plots(curves, "REBA")


def weight_figure(model: QuadraticModel, domain: Domain) -> Any:
    """Return bars of the largest contribution of each angle: weight times range of its polynomial over the limits."""
    import plotly.graph_objects as go

    names, contributions = [], []
    for name, column in _angles(domain):
        if column in model.joints_:
            index = model.joints_.index(column)
            angle = np.linspace(*domain.limits[column], POINTS)
            values = model.weights_[index] * np.polyval(model.polynomials_[index][::-1], angle)
            names.append(name)
            contributions.append(float(np.ptp(values)))
    figure = go.Figure(go.Bar(x=contributions, y=names, orientation="h", marker_color=MODEL_COLOUR))
    figure.update_layout(**_layout(360), xaxis_title="largest difference")
    figure.update_yaxes(autorange="reversed", automargin=True)
    return figure


def _angles(domain: Domain) -> list[tuple[str, str]]:
    """Return name and column (left of two sides) of each angle that varies."""
    return [(a.name.replace("_", " "), a.columns[0]) for a in ANGLES if a.columns[0] in domain.columns]


def _steps(bins: Bins) -> tuple[Array, Array]:
    """Return angles [deg] and points above the lowest of the step function of bins, as a polyline."""
    points = np.array(bins.points, float)
    return np.repeat(bins.edges, 2)[1:-1], np.repeat(points - points.min(), 2)


def _small_plots(curves: list[tuple[str, Array, Array, tuple[Array, Array]]], unit: str) -> list[Any]:
    """Return one figure for each curve, so that the page can choose the number of columns by its width."""
    import plotly.graph_objects as go

    figures = []
    for title, angle, values, steps in curves:
        figure = go.Figure()
        figure.add_scatter(x=steps[0], y=steps[1], mode="lines", line={"color": TRUE, "width": 1.5}, name="table")
        figure.add_scatter(x=angle, y=values, mode="lines", line={"color": MODEL_COLOUR, "width": 2}, name="model")
        figure.update_layout(**_layout(190), showlegend=False, title={"text": title, "font": {"size": 13}, "x": 0.5})
        figure.update_layout(margin={"l": 44, "r": 12, "t": 30, "b": 34}, yaxis_title=unit)
        tick_step = next((step for step in TICK_STEPS if 3 * step >= np.ptp(angle)), TICK_STEPS[-1])
        # Differences under one point are not magnified: half the axis is at least 0.6 points.
        low, high = (float(end(np.concatenate([values, steps[1]]))) for end in (np.min, np.max))
        half = max((high - low) * 0.54, 0.6)
        figure.update_yaxes(range=[(low + high) / 2 - half, (low + high) / 2 + half], nticks=5)
        figure.update_xaxes(ticksuffix="°", dtick=tick_step, tick0=0, tickangle=0)
        figures.append(figure)
    return figures


def _layout(height: int) -> dict[str, Any]:
    return {
        "height": height, "margin": {"l": 60, "r": 20, "t": 40, "b": 60}, "template": "none",
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": TRUE},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"},
    }  # fmt: skip
