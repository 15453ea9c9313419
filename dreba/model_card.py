"""Card of a model: what it prefers, where it has no lower bound, its error, its use as a cost, the factors it knows."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import reba
from dreba.domain import Domain, domain_of
from dreba.errors import FactorWarning, ModelError
from dreba.sampling.classes import true_scores
from dreba.sampling.sample import sample
from dreba.surrogates.base import Surrogate
from dreba.surrogates.metrics import PUBLISHED, published_overall, with_error
from reba.arrays import Array
from reba.files import from_json
from reba.open_file import read_settings
from reba.posture.columns import ANGLES, BEST, COLUMNS, GROUP_A, GROUP_B, INDEX, SIDES
from reba.posture.named_angles import LARGEST
from reba.printable import printable
from reba.provenance import generator

STARTS: Final = 8
"""Random postures, beside that at rest, from which a minimum is sought."""
MOVED: Final = 2.0
"""[deg] An angle of the minimum that is farther from rest than this is named."""
FALLING: Final = 1e-3
"""[1/deg] A value that falls by more than this at the largest angle of all has no lower bound in this direction."""
FACTORS: Final[dict[str, dict[str, Any]]] = {
    "15 kg": {"load": 15.0},
    "unacceptable grip": {"coupling": "unacceptable"},
    "both": {"load": 15.0, "coupling": "unacceptable"},
    "two activity points": {"static": True, "repeated": True},
}
"""Factors of which a card has the mean rise of the value, beside that of exact REBA."""
POSES: Final = 2000
PARTS: Final = (*GROUP_A, *(f"{part}_{side}" for part in GROUP_B for side in SIDES))


def model_card(model: Surrogate, name: str, usefulness: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the card of a model as plain data.

    Args:
        model: fitted, on columns of the posture table.
        name: of the model, also in `usefulness`.
        usefulness: table of `dreba.evaluation.usefulness.enable`; the rows of the model of this name are kept.

    Raises:
        ModelError: the model has a column that is not in the posture table.

    Example:
        >>> import dreba
        >>> card = model_card(dreba.load("quadratic"), "quadratic")
        >>> card["minimum"]["reba"], card["unbounded"], card["factors"]
        (1, [], ['load', 'coupling', 'activity'])
    """
    unknown = [joint for joint in model.joints_ if joint not in INDEX]
    if unknown:
        raise ModelError(f"the model has the column {unknown[0]!r}; a card needs columns of reba.COLUMNS")
    domain = Domain.from_dict(model.about_.domain) if model.about_.domain else domain_of("human")
    lowest = minimum_in(model, domain)
    origin = model.about_.provenance
    errors = np.array(list(model.about_.rmse.values()))
    return {
        "name": name,
        "kind": model.kind,
        "setting": model.setting,
        "source": origin.get("source", ""),
        "command": origin.get("command", ""),
        "joints": len(model.joints_),
        "convex": model.convex,
        "factors": list(model.factors_),
        "rise": rises(model),
        "minimum": _minimum(model, domain, lowest),
        "unbounded": falling_columns(model, lowest, domain),
        "rmse": {
            "classes": dict(model.about_.rmse),
            "overall": float(np.sqrt(np.mean(errors**2))) if errors.size else None,
            "on": origin.get("rmse_on", ""),
            "domain": domain.name,
        },
        "usefulness": None if usefulness is None else _usefulness_of(usefulness, name),
    }


def minimum_in(model: Surrogate, domain: Domain) -> Array:
    """Return the posture (d,) [deg] of the lowest value within the limits of a domain, from rest and random starts."""
    from scipy.optimize import minimize
    from threadpoolctl import threadpool_limits

    columns = [INDEX[joint] for joint in model.joints_]
    low, high = domain.low[columns], domain.high[columns]
    rest = np.clip([BEST[joint] for joint in model.joints_], low, high)
    starts = [rest]
    if not model.convex:
        rng = np.random.default_rng(0)
        starts += list(rng.uniform(low, high, (STARTS, len(low))))
    with threadpool_limits(1):  # of matrices as small as these, threads only wait for each other
        minima = [
            minimize(model.value_and_gradient, start, jac=True, bounds=list(zip(low, high, strict=True)),
                     method="L-BFGS-B", options={"maxiter": 5000})
            for start in starts
        ]  # fmt: skip
    best = min(minima, key=lambda each: float(each.fun))
    return np.asarray(best.x)


def _minimum(model: Surrogate, domain: Domain, lowest: Array) -> dict[str, Any]:
    """Return the value and the exact score of the posture (d,) of the lowest value."""
    rest = np.array([BEST[joint] for joint in model.joints_])
    pose = np.array([BEST[column] for column in COLUMNS])
    pose[[INDEX[joint] for joint in model.joints_]] = lowest
    scores = reba.score_array(pose[None])
    moved = {joint: float(lowest[i]) for i, joint in enumerate(model.joints_) if abs(lowest[i] - rest[i]) > MOVED}
    return {
        "value": float(model.value(lowest)),
        "value_at_rest": float(model.value(rest)),
        "angles": moved,
        "reba": int(scores.reba[0]),
        "parts": {part: int(getattr(scores, part)[0]) for part in PARTS},
        "reba_of_domain": int(true_scores(domain, pose[None], None)[0]),
    }


def falling_columns(model: Surrogate, lowest: Array, domain: Domain) -> list[str]:
    """Return the columns in which the value still falls far outside the limits, with the direction."""
    falling = []
    for index, joint in enumerate(model.joints_):
        for sign, word in ((-1.0, "below"), (1.0, "above")):
            line = np.tile(lowest, (2, 1))
            line[:, index] = sign * np.array([LARGEST - 10.0, LARGEST])
            near, far = model.value(line)
            if far < near - 10.0 * FALLING:
                limit = domain.limits[joint][0 if sign < 0 else 1]
                falling.append(f"{joint} {word} {limit:g}")
    return falling


def rises(model: Surrogate) -> dict[str, dict[str, float]]:
    """Return the mean rise of the value with factors on balanced poses, and that of exact REBA."""
    poses = sample(POSES, rng=4)
    angles = poses.angles[:, [INDEX[joint] for joint in model.joints_]]
    plain = model.value(angles)
    out = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FactorWarning)  # the card names the known factors
        for name, given in FACTORS.items():
            exact = reba.score_array(poses.angles, given).reba.astype(float) - poses.reba
            out[name] = {"model": float(np.mean(model.value(angles, **given) - plain)), "exact": float(exact.mean())}
    return out


def _usefulness_of(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the rows of one model of a table of usefulness, and the conditions of the table."""
    rows = [dict(row) for row in table["rows"] if row["model"] == name]
    return {key: table[key] for key in ("space", "tasks", "solver", "certified")} | {"rows": rows}


def usefulness_table(path: str | Path) -> dict[str, Any]:
    """Return the table of usefulness of a file of `dreba compare --json`; ModelError for another file."""
    wrong = f"{path}: has no table of usefulness; give the output of `dreba compare --json` with reach tasks"
    try:
        table: dict[str, Any] = from_json(read_settings(path))["enabler"]
        for name in (table["rows"][0]["model"], *(row["model"] for row in table["rows"])):
            _usefulness(_usefulness_of(table, name), name, len(COLUMNS))  # whatever a card needs is there
    except OSError as error:
        raise ModelError(
            f"{path}: cannot be read ({error.strerror or error}); give the output of `dreba compare --json`"
        ) from error
    except (ValueError, ArithmeticError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(wrong) from error
    return table


def page(cards: Sequence[Mapping[str, Any]]) -> str:
    """Return cards as one page of Markdown."""
    return "\n".join([_INTRODUCTION, *(as_text(card) for card in cards), f"Written by {generator()}.\n"])


_INTRODUCTION: Final = """\
# Models, one by one

What each model prefers and knows, as `dreba card` measures it. True REBA is exact, by the rules `measured`. Where a
value has no lower bound, an optimiser that leaves the limits finds postures that cost less than any inside: keep to the
limits. The mean rise with a factor is over 2,000 poses balanced over REBA 1 to 10, with that of exact REBA in brackets.
"""


def as_text(card: Mapping[str, Any]) -> str:
    """Return the card as Markdown."""
    least, rmse = card["minimum"], card["rmse"]
    degrees = {column: f"{angle:.0f}" for column, angle in least["angles"].items()}
    moved = []
    for angle in ANGLES:
        sides = {column: degrees[column] for column in angle.columns if column in degrees}
        alike = len(sides) == len(angle.columns) and len(set(sides.values())) == 1
        if alike:
            sides = {angle.name: degrees[angle.columns[0]]}
        moved += [f"{name} {at}" for name, at in sides.items()]
    above = {part: score for part, score in least["parts"].items() if score > 1}
    parts = (
        ", ".join(f"{part} {score}" for part, score in above.items()) if above else "every part has its lowest score"
    )
    if rmse["domain"] == "paper" and least["reba_of_domain"] != least["reba"]:
        parts += f"; {least['reba_of_domain']} by the bins of its domain"
    rise = "; ".join(f"{name} {one['model']:.2f} ({one['exact']:.2f})" for name, one in card["rise"].items())
    lines = [
        f"## `{card['name']}`",
        "",
        f"- Setting: {card['setting']}; {card['joints']} columns{'; convex' if card['convex'] else ''}.",
        *([f"- Source: {card['source']}."] if card["source"] else []),
        f"- Made by: `{card['command']}`." if card["command"] else "- Made by: not noted.",
        f"- Lowest value within the limits: {least['value']:.2f} (at rest {least['value_at_rest']:.2f}), "
        f"{'at ' + ', '.join(moved) + ' degrees, else' if moved else ''} at rest. "
        f"True REBA there: {least['reba']}; {parts}.".replace("  ", " "),
        "- Without a lower bound outside the limits: "
        + (", ".join(card["unbounded"]) if card["unbounded"] else "no column")
        + ".",
        f"- Factors known: {', '.join(card['factors']) or 'none'}. Mean rise on balanced poses (exact REBA): {rise}.",
        "",
        *_errors(rmse),
        "",
        *_usefulness(card["usefulness"], card["name"], card["joints"]),
    ]
    return "".join(f"{printable(line)}\n" for line in lines)


def _errors(rmse: Mapping[str, Any]) -> list[str]:
    if not rmse["classes"]:
        return ["RMSE: not noted."]
    scores = list(rmse["classes"])
    own = " | ".join(f"{rmse['classes'][score]:.2f}" for score in scores)
    paper = " | ".join(f"{PUBLISHED[int(score)]:.2f}" if int(score) in PUBLISHED else "-" for score in scores)
    return [
        f"RMSE per REBA class on {rmse['on'] or 'poses that its file names'}, domain {rmse['domain']}:",
        "",
        f"| REBA | {' | '.join(scores)} | all |",
        f"|---|{'---|' * (len(scores) + 1)}",
        f"| RMSE | {own} | {rmse['overall']:.2f} |",
        f"| Table I | {paper} | {published_overall(map(int, scores)):.2f} |",
    ]


def _usefulness(table: Mapping[str, Any] | None, name: str, joints: int) -> list[str]:
    if joints < len(COLUMNS):
        return [f"Usefulness as a cost: not measured, the reach tasks need all {len(COLUMNS)} columns."]
    if table is None:
        return [f"Usefulness as a cost: `dreba compare {name}` measures it."]
    if not table["rows"]:
        return [f"Usefulness as a cost: not in the table that was given; `dreba compare {name}` measures it."]
    known = table["certified"]
    lines = [
        f"Usefulness as a cost (`dreba compare --tasks {table['space']}:{table['tasks']}`): true REBA of the postures "
        f"reached on {table['tasks']} tasks from two starts of each kind, standard errors in brackets; its difference "
        f"to a cost that knows no REBA, the distance to rest; and to the least that is possible, {known['proved']:.2f} "
        f"proved, certified for {known['tasks']} tasks. {table['solver']}.",
        "",
        "| minimised | start | true REBA | to the distance | to the least | out of reach | evaluations |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in table["rows"]:
        cells = [
            row["name"].replace("|", "\\|"), row["start"], with_error(row["reba"], row["standard_error"]),
            with_error(row["difference"], row["difference_standard_error"], "+"),
            f"{row['reba'] - row['certified']:+.2f}", f"{100 * row['infeasible']:.1f} %", f"{row['evaluations']:.0f}",
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return lines
