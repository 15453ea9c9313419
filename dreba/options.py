"""What the commands of `dreba` take in common: which poses are meant, and how a model is made from text."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from dreba.domain import DOMAINS, Domain, domain_of
from dreba.errors import ModelError, SampleError
from dreba.sampling.classes import WEIGHTS
from dreba.sampling.poses import MEASURED, NEUTRAL, Poses, columns_named
from dreba.sampling.sample import FACTOR_NAMES
from dreba.sampling.sample import sample as draw
from reba.errors import did_you_mean

if TYPE_CHECKING:
    from dreba.surrogates.base import Surrogate

HIGHEST: Final = 99
"""End of a range of classes: enough to name the first one that is no REBA score."""
CLASSES: Final = "1:10"
"""Classes that are drawn where nobody says anything else."""
Command = Callable[..., Any]


def drawing_options(command: Command) -> Command:
    """Add the options that say which poses are drawn."""
    for option in (
        click.option("--adjustments/--no-adjustments", default=True, help="Twists, side bends, abduction and so on."),
        click.option("--arms", default="both", type=click.Choice(["both", "left", "right"]), help="Arms that move."),
        click.option("--factors", default="", metavar="LIST", help=f"Drawn as well: {','.join(FACTOR_NAMES)}."),
        click.option("--stratified", is_flag=True, help="Fill part scores evenly to within one pose."),
        click.option("--weights", default="bins", type=click.Choice(WEIGHTS), help="Likeliness inside a class."),
        click.option("--domain", default=None, metavar="NAME|FILE.toml", help=f"Joint limits: {', '.join(DOMAINS)}."),
        click.option("--seed", default=0, type=click.IntRange(min=0), show_default=True, help="Seed of the draws."),
        click.option("--classes", default=None, metavar="A:B|LIST", help=f"REBA scores to fill, else {CLASSES}."),
        click.option("-n", "--number", "n", default=10_000, type=int, show_default=True, help="Number of poses."),
    ):
        command = option(command)
    return command


joints_option = click.option(
    "--joints", default=None, metavar="LIST", help=f"Columns the model works on, or {MEASURED}: those of the recording."
)
_POSES_HELP = "Poses of `dreba sample`, or any recording, instead of drawing."
_HOLD_HELP = f"Angles that are held: {NEUTRAL} (those not measured, at rest), or COLUMN=DEGREES, by commas."


def poses_options(command: Command) -> Command:
    """Add the options of poses from a file."""
    for option in (
        click.option("--hold", default=None, metavar="LIST", help=_HOLD_HELP),
        click.option("--poses", "poses_file", default=None, metavar="FILE", help=_POSES_HELP),
    ):
        command = option(command)
    return command


def refuse_drawing(poses_file: str | None, *fine: str) -> None:
    """Refuse options that say how poses are drawn where a file gives them, but for `fine` ones.

    Raises:
        SampleError: one of them was given.
    """
    if poses_file is None:
        return
    context = click.get_current_context()
    for name in ("n", "classes", "domain", "weights", "stratified", "factors", "arms", "adjustments"):
        if name not in fine and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = "-n" if name == "n" else f"--{name}"
            raise SampleError(f"{option} says how poses are drawn, but {poses_file} gives them; leave it out")


def draw_poses(given: dict[str, Any], rng: Any, domain: str | Domain = "human", classes: str = CLASSES) -> Poses:
    """Return the poses that `drawing_options` ask for; `domain` and `classes` where they ask for none."""
    names = [name.strip() for name in given["factors"].split(",") if name.strip()]
    return draw(
        given["n"],
        classes_of(classes if given["classes"] is None else given["classes"]),
        domain=given["domain"] or domain,
        rng=rng,
        weights=given["weights"],
        stratified=given["stratified"],
        factors=names or None,
        adjustments=given["adjustments"],
        arms=given["arms"],
    )


def classes_of(text: str) -> list[int]:
    """Return the scores of "1:10" or "1,2,5".

    Raises:
        SampleError: it is neither.
    """
    try:
        low, colon, high = text.partition(":")
        return (
            list(range(int(low), min(int(high), HIGHEST) + 1)) if colon else [int(score) for score in text.split(",")]
        )
    except ValueError as error:
        raise SampleError(f"classes are {text!r}; expected FIRST:LAST or a list such as 1,2,5") from error


def joints_of(text: str | None) -> str | tuple[str, ...] | None:
    """Return what `--joints` says: "measured", columns, or None."""
    if text is None or text == MEASURED:
        return text
    return columns_named(name.strip() for name in text.split(",") if name.strip())


def hold_of(text: str | None) -> str | dict[str, float] | None:
    """Return what `--hold` says: "neutral", columns with their angles [deg], or None.

    Raises:
        SampleError: it is neither.
    """
    if text is None or text == NEUTRAL:
        return text
    held: dict[str, float] = {}
    for item in text.split(","):
        name, _, angle = item.partition("=")
        try:
            degrees = float(angle)
        except ValueError as error:
            raise SampleError(
                f"hold is {item!r}; expected {NEUTRAL} alone, or COLUMN=DEGREES by commas, such as wrist_twist=0"
            ) from error
        held |= dict.fromkeys(columns_named([name.strip()]), degrees)
    return held


def drawn_domain(domain: str | None, joints: Any, hold: Any) -> Domain:
    """Return the domain to draw from: other columns than `joints` at rest, and those of `hold` at their angle.

    Raises:
        SampleError: `joints` is "measured", which only a recording can answer.
    """
    if joints == MEASURED:
        raise SampleError(f"--joints {MEASURED} is about recordings; give --poses, or a list of columns")
    chosen = domain_of(domain or "human")
    if joints is not None:
        chosen = chosen.only(joints)
    return chosen.hold(**hold) if isinstance(hold, dict) else chosen


def unfitted(kind: str, options: tuple[str, ...], domain: str | Domain | None, joints: Any) -> Surrogate:
    """Return a model with its parameters set.

    Raises:
        ModelError: an unknown kind or option.
    """

    from dreba.surrogates.library import KINDS

    if kind not in KINDS:
        raise ModelError(f"kind {kind!r} is unknown{did_you_mean(kind, KINDS)}; known: {', '.join(sorted(KINDS))}")
    known = KINDS[kind]().get_params(deep=False)
    parameters: dict[str, Any] = {"joints": joints}
    if domain is not None and "domain" in known:
        parameters["domain"] = domain
    for text in options:
        name, equals, value = text.partition("=")
        if not equals or name not in known:
            near = did_you_mean(name, known)
            raise ModelError(f"option {text!r} is not NAME=VALUE of kind {kind!r}{near}; known: {', '.join(known)}")
        if name == "joints":
            raise ModelError("joints are named by --joints; leave the option out")
        try:
            parameters[name] = json.loads(value)
        except json.JSONDecodeError:
            parameters[name] = value
    return KINDS[kind](**parameters)


def refuse_same_files(outputs: dict[str, str | None], *inputs: str | None) -> None:
    """Refuse an output that is one of the inputs or another output, before anything is computed.

    Raises:
        ModelError: two of them are the same file.
    """
    taken = {Path(path).resolve() for path in inputs if path is not None}
    for option, path in outputs.items():
        if path is None:
            continue
        if Path(path).resolve() in taken:
            raise ModelError(f"{option} {path} is a file of this command already; choose another name")
        taken.add(Path(path).resolve())
