"""Options that several commands of `reba` have: how a recording is read, and by what it is scored."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from reba.batch.run import ScoringOptions
from reba.command_line import LOAD, MOST, SECONDS, Number
from reba.method.measurement_error import MEASUREMENTS
from reba.method.rules import PRESETS
from reba.posture.factors import COUPLINGS, SUPPORTS

RULES = "|".join((*PRESETS, "FILE.toml"))
"""What `--rules` may be."""


def reading_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for reading recordings."""
    for option in (
        click.option("--strict", is_flag=True, help="Refuse a truncated recording, and one with losses over 1 %."),
        click.option(
            "--rate", type=Number(0, MOST, min_open=True), metavar="HZ", help="Rate of a recording without times."
        ),
        click.option("--neutral", default="none", metavar="first:3s|at:T|none", help="Posture that counts as neutral."),
        click.option("--end", type=SECONDS, metavar="SECONDS", help="Last time to use; all of the recording decides."),
        click.option("--start", type=SECONDS, metavar="SECONDS", help="First time to use, as the tables print times."),
        click.option("--body", default=None, metavar="ID", help="Body to use, if a stream has several."),
        click.option("--topic", default=None, help="Topic or stream to use, if a recording has several."),
        click.option(
            "--profile", default="auto", metavar="NAME|FILE.toml", help="Meaning of the names: `reba profiles`."
        ),
    ):
        command = option(command)
    return command


error_option = click.option(
    "--error", default=None, metavar="|".join((*MEASUREMENTS, "FILE.toml")),
    help="Measurement error of the angles: adds the most likely score, a range of 95 % and probabilities.",
)  # fmt: skip
"""Of commands that show what an error implies."""


def scoring_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for scoring postures, after those for reading."""
    for option in (
        click.option(
            "--missing",
            default="range",
            type=click.Choice(["range", "neutral", "worst", "error"]),
            help="Value of scores that unmeasured angles leave undetermined.",
        ),
        click.option("--activity", default="auto", metavar="auto|none|LIST", help="LIST: static,repeated,unstable."),
        click.option("--arm-supported", is_flag=True, default=None, help="Both arms are supported."),
        click.option("--support", type=click.Choice(SUPPORTS), default=None, help="Support of the body by the legs."),
        click.option("--coupling", type=click.Choice([*COUPLINGS, "0", "1", "2", "3"]), default=None, help="Grip."),
        click.option("--shock", is_flag=True, default=None, help="Shock or rapid build-up of force."),
        click.option("--load", type=LOAD, default=None, metavar="KG", help="Load in kilograms."),
        click.option(
            "--rules",
            default=None,
            metavar=RULES,
            help="Rules to score by.  [default: measured; of scores those that they were recorded with]",
        ),
    ):
        command = option(command)
    return reading_options(command)


def options_of(values: dict[str, Any], *, recorded: bool = False) -> ScoringOptions:
    """Return the record of the values that click gives for `scoring_options`.

    Args:
        recorded: files of scores are scored by the rules that they were recorded with, if no others are named.
    """
    if values["rules"] is None and not recorded:
        values["rules"] = "measured"
    names = ("load", "shock", "coupling", "support", "arm_supported")
    factors = {name: values.pop(name) for name in names}
    return ScoringOptions(factors={name: value for name, value in factors.items() if value is not None}, **values)
