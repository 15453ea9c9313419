"""The report of a model: one HTML file that needs no network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from dreba import report_figures as figures
from dreba.domain import Domain, domain_of
from dreba.evaluate import PUBLISHED, PUBLISHED_OVERALL, angles_for, distance_to_published, evaluation_of
from dreba.model import Surrogate
from dreba.poses import Poses
from dreba.quadratic import QuadraticModel
from reba.posture import COLUMNS
from reba.report.templates import template

WORST: Final = 6
"""Poses shown with the largest errors."""


def write_report(
    path: str | Path,
    model: Surrogate,
    poses: Poses,
    *,
    name: str = "",
    command: str = "",
    temperature: float | None = None,
) -> None:
    """Write the report of a model on poses with their true scores.

    Args:
        path: file to write.
        model: fitted.
        poses: that the model has not seen.
        name: of the model, for the title.
        command: command line to show, so that the report can be made again.
        temperature: [deg] for kinds that have one.

    Raises:
        reba.RebaError: the file cannot be written.
    """
    from reba.writers import write_atomic

    html = render(model, poses, name=name, command=command, temperature=temperature)

    def write(part: Path) -> None:
        part.write_text(html, encoding="utf-8")

    write_atomic(Path(path), write)


def render(
    model: Surrogate, poses: Poses, *, name: str = "", command: str = "", temperature: float | None = None
) -> str:
    """Return the report as HTML; arguments as in `write_report`."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    given = poses.given
    values = model.value(
        angles_for(model, poses),
        load=given.load,
        coupling=given.coupling,
        activity=given.activity,
        temperature=temperature,
    )
    found = evaluation_of(model.kind, values, poses.reba)
    domain = _domain(model)
    plots = {
        "errors": [figures.error_figure(found)],
        "values": [figures.value_figure(values, poses.reba)],
        "sweeps": figures.sweep_figures(model, domain, temperature),
    }
    if isinstance(model, QuadraticModel):
        plots["weights"] = [figures.weight_figure(model, domain)]
        if not model.free:
            plots["polynomials"] = figures.polynomial_figures(model, domain)
    return template("dreba", "report.html", scripted=True).render(
        name=name or model.kind,
        model=model,
        found=found,
        published=PUBLISHED,
        published_overall=PUBLISHED_OVERALL,
        distance=distance_to_published(found) if set(PUBLISHED) <= set(found.classes) else None,
        domain=domain,
        options=[(key, str(value)) for key, value in model.get_params(deep=False).items()],
        provenance=[(key, v if isinstance(v, str) else json.dumps(v)) for key, v in model.about_.provenance.items()],
        worst=_worst(values, poses),
        plots={key: [Markup(_script_safe(one.to_json(validate=False))) for one in some] for key, some in plots.items()},
        command=command,
        temperature=temperature,
        plotly=Markup(get_plotlyjs()),
    )


def _domain(model: Surrogate) -> Domain:
    """Return the domain a model was fitted in, "human" where it is not known."""
    return Domain.from_dict(model.about_.domain) if model.about_.domain else domain_of("human")


def _worst(values: np.ndarray, poses: Poses) -> list[dict[str, Any]]:
    """Return the poses with the largest errors, each with its figure and the angles that are not at rest."""
    from markupsafe import Markup

    from reba.report.phrases import angle_name
    from reba.report.stickfigure import stick_figure

    error = values - poses.reba
    found = []
    for row in np.argsort(-np.abs(error))[:WORST]:
        angles = poses.angles[row]
        largest = np.argsort(-np.abs(angles))[:8]
        found.append(
            {
                "true": int(poses.reba[row]),
                "value": float(values[row]),
                "error": float(error[row]),
                "angles": ", ".join(f"{angle_name(COLUMNS[i])} {angles[i]:.0f}°" for i in largest),
                "figure": Markup(stick_figure(angles, {}, f"pose with true REBA {poses.reba[row]}")),
            }
        )
    return found


def _script_safe(text: str) -> str:
    """Return JSON that can stand inside a script element."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
