"""The `reba` command."""

from __future__ import annotations

from reba.interrupts import enter

if __name__ == "__main__":
    enter("reba.cli")  # under its own name, and before the other imports

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from reba._version import __version__
from reba.app.command import app_command
from reba.batch.run import find_inputs, plan_outputs, score_many, scores_output
from reba.command_line import (
    GROUP,
    LOAD,
    MOST,
    SECONDS,
    Group,
    Number,
    OutputType,
    Stop,
    echo,
    echo_notes,
    json_option,
    parallel_options,
    print_json,
    report_form,
    report_options,
    run,
)
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS
from reba.posture.factors import COUPLINGS, SUPPORTS
from reba.scoring_options import RULES, error_option, options_of, reading_options, scoring_options
from reba.writers import check_as_ros, table_output

LEVEL_NAMES = [risk.replace(" ", "-") for risk, _ in ACTION_LEVELS]
"""Names of the action levels as values of options, such as very-high."""


@click.group(cls=Group, context_settings=GROUP)
@click.version_option(__version__, prog_name="reba")
def cli() -> None:
    """Exact REBA scores from recordings of posture.

    \b
    Start with:  reba info RECORDING      contents, and what REBA can use of them
    Then:        reba score RECORDING     scores, exposure and a report
    """


@cli.command(epilog="Example: reba score shift.mcap --load 8 --coupling fair -o shift.parquet --report shift.html")
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...")
@click.option(
    "-o", "--output", type=OutputType(scores_output), metavar="OUT",
    help="Score table (.parquet .csv .mcap .xlsx), or the folder of a growing dataset.",
)  # fmt: skip
@click.option("--as-ros", is_flag=True, help="Scores in an .mcap as ROS messages, not as JSON: for rosbags, ROS tools.")
@report_options
@scoring_options
@error_option
@parallel_options
@json_option
def score(
    inputs: tuple[str, ...], output: str | None, as_ros: bool, jobs: int, scheduler: str | None, as_json: bool,
    **values: Any,
) -> None:  # fmt: skip
    """Score recordings: files, or folders of them.

    A folder as output is a Parquet dataset with one partition per recording. Recordings whose scores it contains are
    not scored again unless they, the rules or the options changed; an interrupted run is continued. An .mcap of an MCAP
    recording is a copy of it with a topic of scores.
    """
    from reba import score_command

    check_as_ros(as_ros, output)
    report, form = report_form(values)
    options = options_of(values).with_files_read()
    paths = find_inputs(inputs)
    file, folder = plan_outputs(inputs, paths, output, report)
    where: dict[str, Any] = {"jobs": jobs, "scheduler": scheduler, "keep_scores": report is not None}
    if folder is not None:
        failed = score_command.into_dataset(folder, paths, options, report, form, as_json, _progress(len(paths)), where)
    else:
        with _progress(len(paths)) as advance:
            results = score_many(paths, file, options, as_ros=as_ros, on_done=advance, **where)
        failed = score_command.show(results, file, report, form, as_json)
    if failed:
        raise Stop(1)


@cli.command(epilog="Example: reba info shift.mcap")
@click.argument("path", metavar="INPUT")
@reading_options
@json_option
def info(path: str, as_json: bool, **values: Any) -> None:
    """Print the contents of a recording, the recognised profile with the reason, and the angles that REBA can use."""
    from reba.readers.info import info as inspect

    contents = inspect(path, **values)
    if as_json:
        print_json(contents.to_dict())
    else:
        from reba.console import show_info
        from reba.terminal import console

        show_info(console(), contents)


@cli.command(epilog="Example: reba compare before.mcap after.mcap --load 8")
@click.argument("a", metavar="A")
@click.argument("b", metavar="B")
@report_options
@scoring_options
@json_option
def compare(a: str, b: str, as_json: bool, **values: Any) -> None:
    """Compare two recordings, such as before and after a change, or files of scores."""
    from reba.analysis.exposure import compare as compare_scores

    report, form = report_form(values)
    options = options_of(values, recorded=True).with_files_read()
    first, second = options.read_and_score(a), options.read_and_score(b)
    if first.rules != second.rules:  # of a file of scores; the other is scored by them too
        rules = (second if first.postures.scored is None else first).rules
        options = replace(options, rules=rules)
        first, second = options.read_and_score(a), options.read_and_score(b)
    echo_notes(first.postures, second.postures)
    if report is not None:
        from reba.score_command import report_on

        report_on([first, second], report, form)
    if as_json:
        result = compare_scores(first, second)
        print_json({**result, "a": {"input": a, **result["a"]}, "b": {"input": b, **result["b"]}})
    else:
        from reba.console import show_comparison
        from reba.report.summary import summarise
        from reba.terminal import console

        show_comparison(console(), summarise(first), summarise(second), (a, b))


@cli.command(epilog="Example: reba explain shift.mcap --at 12.5")
@click.argument("path", metavar="INPUT")
@click.option("--at", "time", type=SECONDS, required=True, metavar="SECONDS", help="Time of the frame.")
@scoring_options
@error_option
@json_option
def explain(path: str, time: float, as_json: bool, **values: Any) -> None:
    """Print the worksheet of one frame: the angle and the rule of every point.

    INPUT is a recording, or a file of scores that `reba score -o` wrote.
    """
    scores = options_of(values, recorded=True).read_and_score(path)
    echo_notes(scores.postures)
    sheet = scores.explain(time)
    if as_json:
        print_json(sheet.to_dict())
    else:
        from reba.console import show_worksheet
        from reba.terminal import console

        show_worksheet(console(), sheet)


@cli.command(epilog="Example: reba improve shift.mcap --load 12   or: reba improve shift.mcap --at 12.5 --to low")
@click.argument("path", metavar="INPUT")
@click.option(
    "--to",
    "to_level",
    type=click.Choice([risk.replace(" ", "-") for risk, _ in ACTION_LEVELS[:-1]]),
    default=None,
    help="Action level to reach; by default medium, and of one frame the next lower one.",
)
@click.option("--at", "time", type=SECONDS, default=None, metavar="SECONDS", help="The smallest changes of one frame.")
@click.option("--all", "every", is_flag=True, help="List every change, not only the first three.")
@scoring_options
@json_option
def improve(path: str, time: float | None, to_level: str | None, every: bool, as_json: bool, **values: Any) -> None:
    """Rank changes of the workplace by the time at high risk that each takes out of the recording.

    Pairs and triples of changes are searched too. With --at, the smallest changes of angles and factors that lower the
    action level of one frame. INPUT is a recording, or a file of scores that `reba score -o` wrote.
    """
    from reba.analysis.advice import advise
    from reba.analysis.exposure import worst_intervals
    from reba.analysis.improve import improve_frame, worst_minute

    scores = options_of(values, recorded=True).read_and_score(path)
    echo_notes(scores.postures)
    stamps = scores.time
    level = None if to_level is None else [risk for risk, _ in ACTION_LEVELS].index(to_level)
    at_least = None if level is None else ACTION_LEVEL_FROM[level + 1]
    advice = advise(scores, at_least=at_least) if time is None else None
    if as_json:
        frames = [scores.frame_at(time)] if time is not None else [one.frame for one in worst_intervals(scores)]
        result: dict[str, Any] = {
            "input": path,
            "rules": scores.rules.name,
            "taken_as_neutral": list(scores.unmeasured),
        }
        result["frames"] = [
            {
                "time": float(stamps[frame]),
                "improvements": [one.to_dict() for one in improve_frame(scores, frame, level)],
            }
            for frame in frames
        ]
        if advice is not None:
            minute = worst_minute(scores)
            of_minute = advise(scores, minute, at_least).to_dict()
            span = {"start": float(stamps[minute[0]]), "end": float(stamps[minute[-1]])}
            result["advice"] = advice.to_dict()
            result["worst_minute"] = {**span, "improvements": of_minute.pop("single"), **of_minute}
        print_json(result)
        return
    from reba.advice_console import show_advice, show_improvements
    from reba.terminal import console

    if advice is not None:
        show_advice(console(), advice, every=every)
    elif time is not None:
        frame = scores.frame_at(time)
        show_improvements(console(), f"frame at {stamps[frame]:.2f} s", improve_frame(scores, frame, level))
    if scores.unmeasured:
        echo("unmeasured angles are neutral at the low end and at their worst at the high end; they are not changed")


@cli.command(epilog="Example: reba convert walk.bvh -o walk.parquet")
@click.argument("path", metavar="INPUT")
@click.option(
    "-o", "--output", required=True, type=OutputType(table_output), metavar="OUT",
    help="Posture table (.parquet .csv .mcap .xlsx).",
)  # fmt: skip
@reading_options
@json_option
def convert(path: str, output: str, as_json: bool, **values: Any) -> None:
    """Convert any readable recording to a posture table in degrees."""
    from reba.readers import read
    from reba.writers import write_postures

    postures = read(path, **values)
    echo_notes(postures)
    write_postures(postures, output)
    result = {"input": path, "output": output, "frames": len(postures.data), "profile": postures.profile}
    if as_json:
        print_json({**result, "unmeasured": list(postures.unmeasured), "assumed": list(postures.assumed)})
    else:
        echo(f"{output}: {result['frames']} frames, profile {postures.profile}")


@cli.command(epilog="Example: reba profiles; reba profiles human_description > mylab.toml")
@click.argument("name", required=False, metavar="[NAME]")
@json_option
def profiles(name: str | None, as_json: bool) -> None:
    """List the known sources with the angles each can and cannot measure, or print one as TOML to start from."""
    from reba.console import describe_profile, show_profiles
    from reba.readers.recording.profile import profile_text
    from reba.readers.recording.profile import profiles as known
    from reba.terminal import console

    if name is not None and not as_json:
        echo(profile_text(name), nl=False, keep="\n\t")
        return
    described = [describe_profile(profile) for profile in known() if name in (None, profile.name)]
    if as_json:
        print_json({"profiles": described})
    else:
        show_profiles(console(), described)


@cli.command(epilog="Example: reba live shift.mcap --load 8 --alert 8 --hold 2   or: sensors | reba live -")
@click.argument("source", metavar="SOURCE")
@click.option("--until-idle", type=Number(0, MOST), metavar="SECONDS", help="End after this long without data.")
@click.option(
    "--foxglove", type=click.IntRange(0, 65535), is_flag=False, flag_value=8765, metavar="[PORT]",
    help="Serve scores and a colored figure to Foxglove or Lichtblick; any web page open in a browser on this machine "
    "can read them meanwhile.",
)  # fmt: skip
@click.option("--window", default="60s", show_default=True, metavar="SECONDS", help="Length of the rolling window.")
@click.option("--hold", default="1s", show_default=True, metavar="SECONDS", help="Time for which a score must persist.")
@click.option("--alert-level", type=click.Choice(LEVEL_NAMES), help="Alert from this action level on.")
@click.option("--alert", type=click.IntRange(1, 15), metavar="SCORE", help="Alert from this score on.  [default: 8]")
@click.option("--settle", default="2s", show_default=True, metavar="SECONDS", help="Data read before the first line.")
@click.option("--neutral", default="none", metavar="first:3s|at:T|none", help="Posture that counts as neutral.")
@click.option(
    "--activity", default="none", show_default=True, metavar="none|LIST", help="LIST: static,repeated,unstable."
)
@click.option("--support", type=click.Choice(SUPPORTS), default=None, help="Support of the body by the legs.")
@click.option("--coupling", type=click.Choice([*COUPLINGS, "0", "1", "2", "3"]), default=None, help="Grip.")
@click.option("--load", type=LOAD, default=None, metavar="KG", help="Load in kilograms.")
@click.option("--rules", default="measured", metavar=RULES, help="Rules to score by.")
@click.option("--topic", default=None, help="Topic to use, if there are several.")
@click.option("--profile", default="auto", metavar="NAME|FILE.toml", help="Meaning of the names: `reba profiles`.")
def live(source: str, **values: Any) -> None:
    """Score postures while they are recorded, one JSON line per frame.

    SOURCE is an MCAP file that is being written, or - for JSON lines on standard input: rows of the posture table or
    joint states. The scores equal those of `reba score --activity none` on the same data. `reba score` decides unit,
    vertical and unmeasured angles from the complete recording, `reba live` from its first seconds (--settle). Activity
    cannot be derived from the movement, because it depends on later frames.
    """
    from reba.live.command import live_options, run_live

    code = run_live(source, live_options(values))
    if code:
        raise Stop(code)


cli.add_command(app_command)


@contextmanager
def _progress(total: int) -> Iterator[Callable[[str], None]]:
    """Give a function that notes each recording done: in a progress bar if there are several and a terminal."""
    if total < 2 or not sys.stderr.isatty():
        yield lambda name: None
        return
    from reba.terminal import ProgressBar

    with ProgressBar("scoring", total) as bar:
        yield lambda name: bar.advance(Path(name).name)


def main() -> None:
    """Run the command and exit; an error is one line on standard error."""
    run(cli, "reba")
