"""The page: template variables of each section, and the environment of the templates."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any, Final

from reba._version import __version__
from reba.analysis import wording
from reba.analysis.advice import SHOWN, advise
from reba.analysis.exposure import INTERVAL_RULE
from reba.analysis.score_table import ScoreTable
from reba.files import as_json
from reba.method.classes import angle_classes
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS
from reba.posture.columns import SIDES
from reba.printable import WITH_UNIT, as_markup, as_script_data, printable
from reba.report import labels
from reba.report.body_map import SCALE, body_map
from reba.report.comparison import compared_figures, differing
from reba.report.error_section import error_section
from reba.report.explorer import cursor_frames, explorer, skeleton
from reba.report.findings import WHY_P90, headline, high_risk_share, sustained_text, worse_side, worst_intervals
from reba.report.labels import LEVEL_COLOURS, LIMITS, PART_COLOURS, PARTS, SOURCES, TEXT_ON
from reba.report.pictures import Pictures
from reba.report.plots import level_bands, time_label, time_svg
from reba.report.sections import (
    activity_rows,
    angle_rows,
    factor_rows,
    part_contributions,
    part_shares,
    rule_rows,
    unmeasured_rows,
)
from reba.report.series import PARTS_OF_MEANS, VIEWS
from reba.report.summary import GRADE_RULE, RecordingSummary, seconds_of_levels, summarise
from reba.report.what_if import what_if

if TYPE_CHECKING:
    from jinja2 import Template

LEVEL_SCORES: Final = tuple(
    f"{low}" if low + 1 == after else f"{low} to {after - 1}"
    for low, after in zip(ACTION_LEVEL_FROM, (*ACTION_LEVEL_FROM[1:], 16), strict=True)
)
"""Scores of each action level as text."""
ERROR_LABEL: Final = "Most likely REBA over time, in the range that holds REBA with a probability of 95 %"
"""Text alternative of the plot under measurement error."""
SCRIPTS: Final = ("figure.js", "timeline.js", "score_track.js", "page.js")
"""What makes a report of recordings with frames interactive, in this order."""
PRINTED: Final = 3
"""Worst postures on the first printed page."""
MIN_LENGTH_RATIO: Final = 0.2
"""Shortest recording as a share of the longest up to which all time axes have equal length; below, the short plot
would be too narrow to read."""


@dataclass(frozen=True)
class Form:
    """What the printed page says beside the figures: free texts, "" for a line to fill in by hand."""

    task: str = ""
    assessor: str = ""
    date: str = ""


def page(
    scores: Sequence[ScoreTable],
    command: str,
    form: Form,
    failed: Sequence[tuple[str, str]],
    privacy: str,
    pictures: Sequence[Pictures],
) -> str:
    """Return the report as HTML text.

    Args:
        command: command line to show, "" for none.
        failed: name and error of recordings that could not be scored.
        privacy: what the page says about names and pictures in it.
        pictures: of a camera, for each recording.
    """
    from markupsafe import Markup

    records = [summarise(one) for one in scores]
    lengths = [record.length for record in records]
    same_axis = min(lengths) >= MIN_LENGTH_RATIO * max(lengths)
    spans = [max(lengths) if same_axis else length for length in lengths]
    filters: dict[str, Callable[..., str]] = {
        "seconds": wording.seconds,
        "moment": wording.moment,
        "percent": wording.percent,
        "breakable": lambda name: Markup(as_markup(name).replace("_", "_<wbr>")),
    }
    scripts = ["\n".join(read("reba.report", name) for name in SCRIPTS)] if any(one.frames for one in records) else []
    return template("reba.report", "template.html", filters, scripts).render(
        levels=[
            {"number": number, "name": name, "action": labels.action(number), "scores": LEVEL_SCORES[number]}
            for number, (name, _) in enumerate(ACTION_LEVELS)
        ],
        sections=[
            _section(i + 1, *one, len(records), max(lengths))
            for i, one in enumerate(zip(records, pictures, spans, strict=True))
        ],
        explorer_model=_json(explorer_model()),
        same_axis=same_axis,
        comparison=compared_figures(*records) if len(records) == 2 else [],
        differing=list(differing(*records)) if len(records) == 2 else [],
        command=command,
        form=form,
        failed=[(name, why.removeprefix(f"{name}: ")) for name, why in failed],
        privacy=privacy,
        interval_rule=INTERVAL_RULE,
        grade_rule=GRADE_RULE,
        why_p90=WHY_P90,
        limits=LIMITS,
        error_label=ERROR_LABEL,
        shown=SHOWN,
        explored=bool(scripts),
        report_style=Markup(read("reba.report", "recording.css")),
        map_scale=SCALE,
        sources=SOURCES,
    )


def explorer_model() -> dict[str, Any]:
    """Return what the timelines of all recordings share: the skeleton, the bands of the levels and the colours."""
    bands = [[low, high, colour, name.capitalize()] for low, high, colour, name in level_bands()]
    return {"skeleton": skeleton(), "levels": bands, "parts": PART_COLOURS, "with_unit": WITH_UNIT}


def _json(data: Any) -> Any:
    from markupsafe import Markup

    return Markup(as_script_data(as_json(data)))


def _section(
    number: int, record: RecordingSummary, pictures: Pictures, span: float, recordings: int, longest: float
) -> dict[str, Any]:
    """Return the template variables of one recording; `span` and `longest` [s]: its time axis, and that of all."""
    from markupsafe import Markup

    intervals = worst_intervals(record)
    postures = record.scores.postures
    elbow = [one for one in angle_classes(record.scores.rules) if one.part == f"lower_arm_{SIDES[0]}"]
    section: dict[str, Any] = {
        "id": f"r{number}",
        "name": record.name,
        "record": record,
        "empty": not record.frames,
        "headline": headline(record),
        "overview": _overview(record) if record.frames else [],
        "severity": high_risk_share(record)[1],
        "views": VIEWS,
        "level_rows": _level_rows(record),
        "intervals": [(one, Markup(one.svg)) for one in intervals],
        "printed": [(one, Markup(one.printed)) for one in intervals[:PRINTED]],
        "parts": part_shares(record),
        "contributions": part_contributions(record),
        "angles": angle_rows(record),
        "unmeasured": unmeasured_rows(record),
        "factors": factor_rows(record),
        "activity": activity_rows(record),
        "rules": rule_rows(record),
        "postures": postures,
        "quality": postures.quality,
        "grade": record.quality_grade,
        "gaps": record.gaps,
        "error": error_section(record),
        "part_titles": PARTS,
        "elbow": elbow[0].classes[-1].text,
        "shared_svg": "",
        "pictures": pictures,
    }
    if record.frames:
        data = {**explorer(record, intervals, span, recordings), "pictures": pictures.packed()}
        table = what_if(record.scores, record.weights)
        section |= {
            "advice": advise(record.scores),
            "body_map": Markup(body_map(record)),
            "time_label": time_label(record),
            "time_svg": Markup(time_svg(record, intervals, span, number=recordings)),
            "shared_svg": Markup(time_svg(record, intervals, longest, number=recordings)) if recordings == 2 else "",
            "explorer": _json(data),
            "part_seconds": record.length / PARTS_OF_MEANS,
            "explored": len(cursor_frames(record, intervals, recordings)),
            "settings": table.settings,
            "what_if": _json({**table.packed(), "seconds": record.seconds}),
        }
    if (error := section["error"]) is not None:
        section["error_svg"] = Markup(time_svg(record, [], span, curve=error.curve, label=ERROR_LABEL))
    return section


def _overview(record: RecordingSummary) -> list[tuple[Any, str, str]]:
    """Return the cells of the overview: what they are sorted by (of ranges the upper end), text, and class."""
    ends, title = record.summary["range"], headline(record)
    return [
        (ends["p90_high"], title.p90, "n strong"),
        (record.sustained[1] or 0, sustained_text(record), "n"),
        (ends["mean_high"], wording.span(ends["mean_low"], ends["mean_high"], 1), "n"),
        (high_risk_share(record)[1], _high_risk(record), "n"),
        (worse_side(record)[0], worse_side(record)[0], ""),
        (record.quality_grade.letter, record.quality_grade.letter, ""),
        (record.seconds, wording.seconds(record.seconds), "n"),
    ]


def _high_risk(record: RecordingSummary) -> str:
    low, high = (wording.percent(share) for share in high_risk_share(record))
    return low if low == high else f"{low} to {high}"


def _level_rows(record: RecordingSummary) -> list[dict[str, Any]]:
    """Return seconds and share of time of each action level for each total: highest level first, undetermined last."""
    of_view = {name: seconds_of_levels(record, name) for name in VIEWS}
    rows = []
    for level in (4, 3, 2, 1, 0, None):
        cells = [
            {"seconds": seconds[level], "share": seconds[level] / (record.seconds or 1.0)}
            for seconds in of_view.values()
        ]
        if level is not None or any(cell["seconds"] > 0 for cell in cells):
            rows.append({"level": level, "cells": cells})
    return rows


BASE = "base.html"
"""Template that pages extend: head, shared style, and the blocks `title`, `style` and `body`."""


def template(
    package: str, name: str, filters: Mapping[str, Callable[..., Any]] | None = None, scripts: Sequence[str] = ()
) -> Template:
    """Return a template of a package; `render` must get every variable that the template uses.

    Every value is escaped, and its hidden characters are shown as in the terminal (`reba.printable`).

    Args:
        package: such as `lgp.study`; its first part is named as the generator of the page.
        scripts: of a page that extends `BASE`, run in this order; its content security policy forbids all others.

    Example:
        >>> print(template("reba.report", "base.html").render()[:15])
        <!DOCTYPE html>
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FunctionLoader(lambda file: read("reba.report" if file == BASE else package, file)),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=lambda value: value if hasattr(value, "__html__") else printable(str(value), "\n\t"),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= dict(filters or {})
    environment.globals |= {
        "program": package.partition(".")[0],
        "version": __version__,
        "style": Markup(_colours() + read("reba.report", "style.css")),
        "dark": Markup(read("reba.report", "dark.css")),
        "scripts": [(_hash(script), Markup(script)) for script in scripts],
    }
    return environment.get_template(name)


def _hash(script: str) -> str:
    """Return the hash by which a content security policy names a script: https://www.w3.org/TR/CSP3/#grammardef-hash-source."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def read(package: str, name: str) -> str:
    """Return the text of a file in a package."""
    return (resources.files(package) / name).read_text(encoding="utf-8")


def _colours() -> str:
    """Return the CSS classes l0 to l4 and p0 to p6: background and a text colour of sufficient contrast."""
    colours = {f"l{i}": colour for i, colour in enumerate(LEVEL_COLOURS)}
    colours |= {f"p{i}": colour for i, colour in enumerate(PART_COLOURS)}
    fills = [
        f".{name} {{ background: {colour}; color: {TEXT_ON.get(colour, '#1b2430')}; }}\n"
        for name, colour in colours.items()
    ]
    edges = [f".l{i}-edge {{ border-left-color: {colour} !important; }}\n" for i, colour in enumerate(LEVEL_COLOURS)]
    return "".join((*fills, *edges))
