"""Options common to the `dreba` commands: drawn poses, poses of a file, and models with their parameters."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from dreba.domain import DOMAINS, Domain, domain_of
from dreba.errors import ModelError, SampleError
from dreba.sampling.classes import WEIGHTS
from dreba.sampling.poses import MEASURED, NEUTRAL, Poses
from dreba.sampling.sample import FACTOR_NAMES, MAX_POSES
from dreba.sampling.sample import sample as draw
from reba.checks import shown
from reba.command_line import SEED
from reba.errors import did_you_mean
from reba.posture.columns import by_column, columns_named

if TYPE_CHECKING:
    from dreba.surrogates.base import Surrogate

CLASSES: Final = "1:10"
"""Default classes, those of the published Table I."""
PAPER: Final = ("class_power=1", "payload=linear", "payload_only=true")
"""Parameters of `--as paper`: the weights of the classes that come nearest to Table I, and equation (4) alone."""
TASK_SPACES: Final = ("wide", "bench")
"""Spaces of the stored reach tasks, see `dreba.evaluation.reach_tasks`."""
MOST_TASKS: Final = 80
"""Stored tasks of each space and seed."""
Command = Callable[..., Any]


def drawing_options(command: Command) -> Command:
    """Add the options of drawn poses to a command."""
    for option in (
        click.option(
            "--adjustments/--no-adjustments", default=True, help="Draw twists, side bends, abduction and so on."
        ),
        click.option(
            "--arms",
            default="both",
            type=click.Choice(["both", "left", "right"]),
            help="Arms drawn; the other is at rest.",
        ),
        click.option("--factors", default="", metavar="LIST", help=f"Factors drawn too: {','.join(FACTOR_NAMES)}."),
        click.option("--stratified", is_flag=True, help="Keep part scores within one pose of their expectation."),
        click.option(
            "--weights", default="bins", type=click.Choice(WEIGHTS), help="Probability of poses inside a class."
        ),
        click.option("--domain", default=None, metavar="NAME|FILE.toml", help=f"Joint limits: {', '.join(DOMAINS)}."),
        click.option("--seed", default=0, type=SEED, show_default=True, help="Seed of the random poses."),
        click.option("--classes", default=None, metavar="A:B|LIST", help=f"REBA scores to draw, default {CLASSES}."),
        click.option(
            "-n",
            "--number",
            "n",
            default=10_000,
            type=click.IntRange(1, MAX_POSES),
            show_default=True,
            help="Number of poses.",
        ),
    ):
        command = option(command)
    return command


def reach_tasks_of(ctx: click.Context, param: click.Parameter, value: str) -> tuple[str, int]:
    """Return space and number of reach tasks of SPACE, SPACE:NUMBER or NUMBER (callback of an option)."""
    first, colon, last = value.partition(":")
    space, count = (first, last if colon else str(MOST_TASKS)) if first in TASK_SPACES else (TASK_SPACES[0], value)
    if not (count.isascii() and count.isdigit() and len(count) < 9 and int(count) <= MOST_TASKS):
        raise click.BadParameter(
            f"{value!r} is no set of reach tasks; expected {' or '.join(TASK_SPACES)}, alone or with a number of tasks "
            f"({TASK_SPACES[0]}:20), or a number from 0 (none) to {MOST_TASKS}"
        )
    return space, int(count)


joints_option = click.option(
    "--joints", default=None, metavar="LIST", help=f"Columns of the model, or {MEASURED}: those of the recording."
)
_POSES_HELP = "File of `dreba sample`, or any recording, instead of drawn poses."
_HOLD_HELP = f"Angles held fixed: {NEUTRAL} (unmeasured ones, at rest), or COLUMN=DEGREES, by commas."


def poses_options(command: Command) -> Command:
    """Add the options of poses of a file to a command."""
    for option in (
        click.option("--hold", default=None, metavar="LIST", help=_HOLD_HELP),
        click.option("--poses", "poses_file", default=None, metavar="FILE", help=_POSES_HELP),
    ):
        command = option(command)
    return command


def refuse_drawing(poses_file: str | None, *allowed: str) -> None:
    """Refuse options of drawn poses together with --poses, except the `allowed` ones (SampleError)."""
    if poses_file is None:
        return
    context = click.get_current_context()
    for name in ("n", "classes", "domain", "weights", "stratified", "factors", "arms", "adjustments"):
        if name not in allowed and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = "-n" if name == "n" else f"--{name}"
            raise SampleError(
                f"{option} is an option of drawn poses, but the poses are those of {poses_file}; leave it out"
            )


def draw_poses(drawing: dict[str, Any], rng: Any, domain: str | Domain = "human", classes: str = CLASSES) -> Poses:
    """Return poses drawn by `drawing_options`; `domain` and `classes` are the defaults of these options."""
    names = [name.strip() for name in drawing["factors"].split(",") if name.strip()]
    return draw(
        drawing["n"],
        classes_of(classes if drawing["classes"] is None else drawing["classes"]),
        domain=drawing["domain"] or domain,
        rng=rng,
        weights=drawing["weights"],
        stratified=drawing["stratified"],
        factors=names or None,
        adjustments=drawing["adjustments"],
        arms=drawing["arms"],
    )


def classes_of(text: str) -> Sequence[int]:
    """Return the scores of "1:10" or "1,2,5"; SampleError for any other text."""
    try:
        low, colon, high = text.partition(":")
        return range(int(low), int(high) + 1) if colon else [int(score) for score in text.split(",")]
    except ValueError as error:
        raise SampleError(f"classes are {shown(text)}; expected FIRST:LAST or a list such as 1,2,5") from error


def joints_of(text: str | None) -> str | tuple[str, ...] | None:
    """Return the value of `--joints`: "measured", columns, or None."""
    if text is None or text == MEASURED:
        return text
    return columns_named((name.strip() for name in text.split(",") if name.strip()), SampleError)


def hold_of(text: str | None) -> str | dict[str, float] | None:
    """Return the value of `--hold`: "neutral", angles [deg] by column from items COLUMN=DEGREES, or None."""
    if text is None or text == NEUTRAL:
        return text
    held: dict[str, float] = {}
    for item in text.split(","):
        name, _, angle = item.partition("=")
        try:
            degrees = float(angle)
        except ValueError as error:
            raise SampleError(
                f"hold is {shown(item)}; expected {NEUTRAL} alone, or COLUMN=DEGREES by commas, such as wrist_twist=0"
            ) from error
        columns_named([name.strip()], SampleError)
        held[name.strip()] = degrees
    return by_column(held)


def drawn_domain(domain: str | None, joints: Any, hold: Any) -> Domain:
    """Return the domain of drawn poses: only `joints` vary, and columns of `hold` have their angle.

    "measured" joints are refused (SampleError): they need a recording.
    """
    if joints == MEASURED:
        raise SampleError(f"--joints {MEASURED} needs a recording; add --poses, or name columns")
    chosen = domain_of(domain or "human")
    if joints is not None:
        chosen = chosen.only(joints)
    return chosen.hold(**hold) if isinstance(hold, dict) else chosen


def as_paper(kind: str, options: tuple[str, ...], drawing: dict[str, Any]) -> tuple[str, ...]:
    """Return the options of the model of the paper, and draw its poses in the domain of its authors.

    Raises:
        SampleError: an option is given that `--as paper` sets, with another value.
    """
    own = [text.partition("=")[0] for text in PAPER]
    for text in options:
        if text.partition("=")[0] in own and text not in PAPER:
            raise SampleError(f"--option {text} is not that of --as paper ({', '.join(PAPER)}); leave out one of them")
    if kind != "quadratic" or drawing["domain"] not in (None, "paper") or drawing["factors"]:
        raise SampleError(
            "--as paper is --kind quadratic in --domain paper without drawn factors; leave out other values of these"
        )
    drawing["domain"] = "paper"
    return (*(text for text in PAPER if text not in options), *options)


def unfitted(kind: str, options: tuple[str, ...], domain: str | Domain | None, joints: Any) -> Surrogate:
    """Return an unfitted model with parameters from texts NAME=VALUE; ModelError for an unknown kind or option."""
    from dreba.surrogates.library import KINDS

    if kind not in KINDS:
        raise ModelError(
            f"kind {kind!r} is unknown{did_you_mean(kind, KINDS)}; expected one of {', '.join(sorted(KINDS))}"
        )
    known = KINDS[kind]().get_params(deep=False)
    parameters: dict[str, Any] = {"joints": joints}
    if domain is not None and "domain" in known:
        parameters["domain"] = domain
    for text in options:
        name, equals, value = text.partition("=")
        if not equals or name not in known:
            near = did_you_mean(name, known)
            raise ModelError(
                f"option {text!r} is not NAME=VALUE of kind {kind!r}{near}; expected one of {', '.join(known)}"
            )
        if name == "joints":
            raise ModelError("--option joints is not allowed; use --joints")
        try:
            parameters[name] = json.loads(value)
        except (ValueError, RecursionError):  # no JSON, too many digits or levels: a text, which the model judges
            parameters[name] = value
    return KINDS[kind](**parameters)
