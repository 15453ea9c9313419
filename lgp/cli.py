"""The `lgp` command."""

from __future__ import annotations

from reba.interrupts import enter, no_garbage

if __name__ == "__main__":
    enter("lgp.cli")  # under its own name, and before the other imports

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from lgp.defaults import SCENE_COST
from lgp.errors import LgpError
from lgp.execution.commands import run_command
from lgp.experiments.variants import VARIANT, variants
from lgp.extensions import run_extension
from lgp.files import ASSETS, EXPERIMENT_FILES, PAGE_FILES, PICTURES, PLAN_FILES
from lgp.scene.scene_file import load_scene, shipped_scenes
from lgp.study.commands import simulate_study, study
from lgp.workplace.command import improve
from reba._version import __version__
from reba.command_line import (
    GROUP,
    MOST,
    SEED,
    Group,
    Number,
    echo,
    json_option,
    output_file,
    output_folder,
    page_command,
    parallel_options,
    print_json,
    print_notes,
    run,
)
from reba.files import write_atomic, write_text
from reba.open_file import read_settings


@click.group(cls=Group, context_settings=GROUP)
@click.version_option(__version__, prog_name="lgp")
@click.option(
    "--extension", "extensions", multiple=True, metavar="FILE.py",
    help="Run this Python file first: it registers actions and cost terms of your own. May be repeated.",
)  # fmt: skip
def cli(extensions: tuple[str, ...]) -> None:
    """Plan the actions and motions of a human and robots, with ergonomics.

    \b
    Start with:  lgp plan screwdriver   a shipped scene, or the path of your own
    """
    for file in extensions:
        run_extension(file)


@cli.command(epilog="Example: lgp plan screwdriver -o plan/ --tree tree.svg")
@click.argument("scene")
@click.option("--cost", metavar="MODEL.json|NAME", help="dREBA model of the ergonomic cost; `convex` by default.")
@click.option("--no-ergonomics", is_flag=True, help="Minimise accelerations only.")
@click.option("--no-collisions", is_flag=True, help="Ignore collisions.")
@click.option(
    "--accept-start", is_flag=True, help="Plan from a start in which bodies are in each other, instead of refusing it."
)
@click.option(
    "--sequence", metavar="FILE", help="Plan the motion of these actions, one per line, instead of searching."
)
@click.option("--depth", type=click.IntRange(1, 40), help="Longest sequence of actions; the scene's by default.")
@click.option(
    "--seconds",
    type=Number(0, MOST, min_open=True),
    help="Time limit of the search, or of a given sequence [s]; the best plan so far is returned.",
)
@click.option(
    "--time-weight", type=Number(0, 1000), metavar="W", help="Cost of a second; the scene's by default (0.2)."
)
@click.option("--height", "heights", multiple=True, metavar="TABLE=M", help="Height of a table [m]; may be repeated.")
@click.option(
    "-o", "--output", type=output_folder(*PLAN_FILES), metavar="DIR",
    help="Write plan.json, plan.txt, path.parquet and postures.parquet there.",
)  # fmt: skip
@click.option("--tree", type=output_file(), metavar="FILE.svg", help="Draw the searched tree.")
@json_option
def plan(
    scene: str,
    cost: str | None,
    no_ergonomics: bool,
    no_collisions: bool,
    accept_start: bool,
    sequence: str | None,
    depth: int | None,
    seconds: float | None,
    time_weight: float | None,
    heights: tuple[str, ...],
    output: str | None,
    tree: str | None,
    as_json: bool,
) -> None:
    """Plan a SCENE: the name of a shipped one, or a TOML file."""
    if cost is not None and no_ergonomics:
        raise LgpError("--cost and --no-ergonomics exclude each other; leave one of them out")
    for option, value in (("--tree", tree), ("--depth", depth)):
        if value is not None and sequence is not None:
            raise LgpError(
                f"{option} and --sequence exclude each other: a sequence is not searched; leave one of them out"
            )
    loaded = load_scene(scene).with_heights(dict(_height(text) for text in heights))
    loaded = loaded if time_weight is None else loaded.with_time_weight(time_weight)
    lines = None if sequence is None else _read(sequence)
    with no_garbage():
        from lgp.console import shown_progress
        from lgp.plan_files import holds_plan
        from lgp.planner import INTERRUPTED
        from lgp.planner import plan as make_plan

    with shown_progress() as on_progress:
        result = make_plan(
            loaded,
            None if no_ergonomics else cost or SCENE_COST,
            sequence=lines,
            depth=depth,
            seconds=float("inf") if seconds is None else seconds,
            collisions=not no_collisions,
            accept_start=accept_start,
            on_progress=on_progress,
        )
    if output is not None and not result.feasible and holds_plan(Path(output)):
        echo(f"lgp: {output}: its former plan is kept", err=True)
        output = None
    if output is not None:
        result.save(output)
    if tree is not None:
        _draw(tree, result)
    summary: dict[str, Any] = {**result.summary(), "output": output}
    if as_json:
        print_json(summary)
    elif result.feasible:
        from lgp.console import show_plan
        from reba.terminal import console

        show_plan(console(), summary)
    if result.status == INTERRUPTED:
        raise KeyboardInterrupt
    if not result.feasible:
        raise LgpError(f"{loaded.name}: no plan: {result.reason}")


@cli.command(epilog="Example: lgp experiment screwdriver --runs 100 --jobs 2 -o results/")
@click.argument("name", type=click.Choice(["screwdriver", "toolbox", "all"]))
@click.option(
    "--runs", default=100, type=click.IntRange(1, MOST), show_default=True, help="Random draws of the table heights."
)
@click.option("--seed", default=0, type=SEED, show_default=True, help="Seed of all draws.")
@click.option("--initial", default="rest", type=click.Choice(["rest", "random"]), help="Initial posture of the human.")
@click.option(
    "--as", "variant", default=VARIANT, type=click.Choice(list(variants())), show_default=True,
    help="What is taken for what the paper leaves open; the report lists it.",
)  # fmt: skip
@click.option("--scene", metavar="FILE.toml", help="Scene with the same tables or parts, the shipped one by default.")
@click.option("--cost", metavar="MODEL.json|NAME", help="dREBA model, the variant's by default.")
@click.option("--weight", type=Number(0, MOST), help="Weight of a score point for a second, the variant's by default.")
@click.option("--phase-seconds", type=Number(0.2, 600), help="Duration of each phase [s], the variant's by default.")
@click.option(
    "--sensitivity",
    default=0,
    type=click.IntRange(0, MOST),
    metavar="RUNS",
    help="Also vary the scene, the cost and the person, one parameter at a time, with this number of runs each.",
)
@click.option(
    "--family", default=0, type=click.IntRange(0, MOST), metavar="RUNS",
    help="Also plan this number of runs for a family of manikins at once: 5th, 50th and 95th percentile of both sexes.",
)  # fmt: skip
@click.option(
    "--pareto", default=0, type=click.IntRange(0, MOST), metavar="RUNS",
    help="Also trace REBA against time and against the robot's effort, with this number of runs for each point.",
)  # fmt: skip
@click.option(
    "--collisions/--no-collisions",
    default=None,
    help="Whether motions are collision-free, which takes several times as long; the variant says so by default.",
)
@click.option("--plans", is_flag=True, help="Keep each plan in a folder of its own, for `lgp page` and `lgp run`.")
@parallel_options
@click.option(
    "-o", "--output", required=True, type=output_folder(*EXPERIMENT_FILES), metavar="DIR",
    help="Results; an interrupted experiment is resumed there.",
)  # fmt: skip
@json_option
@click.pass_context
def experiment(
    context: click.Context,
    name: str,
    runs: int,
    seed: int,
    initial: str,
    variant: str,
    scene: str | None,
    cost: str | None,
    weight: float | None,
    phase_seconds: float | None,
    sensitivity: int,
    family: int,
    pareto: int,
    collisions: bool | None,
    plans: bool,
    jobs: int,
    scheduler: str | None,
    output: str,
    as_json: bool,
) -> None:
    """Repeat an experiment of the paper: tables, figures and tests, ours beside the published ones.

    \b
    screwdriver   choice of one of three tables of random heights
    toolbox       order of actions in one scene; takes no option about draws
    all           both in all variants and from both initial postures, and a
                  table that compares them with the paper
    """
    draws: dict[str, Any] = {
        "runs": runs,
        "seed": seed,
        "jobs": jobs,
        "scheduler": scheduler,
        "sensitivity": sensitivity,
        "family": family,
        "pareto": pareto,
    }
    if name == "all":
        given = [option for option in ONE_VARIANT if _given(context, option)]
        if given:
            option = {"variant": "as"}.get(given[0], given[0].replace("_", "-"))
            raise LgpError(f"--{option} is of one experiment, and `all` plans every variant; leave it out")
        _all(output, draws, as_json)
        return
    common: dict[str, Any] = {
        "variant": variant,
        "scene": scene,
        "cost": cost,
        "weight": weight,
        "phase_seconds": phase_seconds,
        "collisions": collisions,
    }
    if name == "toolbox":
        given = [option for option in draws | {"initial": initial, "plans": plans} if _given(context, option)]
        print_notes(f"--{option} is about draws, and the toolbox draws nothing: it changes nothing" for option in given)
        _toolbox(output, common, as_json)
        return
    from lgp.experiments.screwdriver_experiment import experiment_screwdriver

    summary = experiment_screwdriver(
        output,
        initial=initial,
        **common,
        **draws,
        plans=plans,
        progress=lambda done, wanted: echo(f"{name}: {done} of {wanted} runs", err=True),
        on_event=lambda event: echo(f"{name}: {event}", err=True),
        command=page_command("lgp"),
    )
    if as_json:
        print_json(summary)
    else:
        echo(f"results are in {output}: report.html, summary.json, runs.parquet, paths.parquet")


def _given(context: click.Context, option: str) -> bool:
    return context.get_parameter_source(option) is ParameterSource.COMMANDLINE


ONE_VARIANT = ("initial", "variant", "scene", "cost", "weight", "phase_seconds", "collisions", "plans")
"""Options of `lgp experiment` that `all` does not take."""


def _all(output: str, draws: dict[str, Any], as_json: bool) -> None:
    from lgp.experiments.all_experiments import experiment_all

    summary = experiment_all(
        output,
        **draws,
        progress=lambda done, wanted: echo(f"all: {done} of {wanted} runs", err=True),
        on_event=lambda event: echo(f"all: {event}", err=True),
        command=page_command("lgp"),
    )
    if as_json:
        print_json(summary)
    else:
        echo(f"results are in {output}: report.html, summary.json, screwdriver/, toolbox/")


def _toolbox(output: str, common: dict[str, Any], as_json: bool) -> None:
    from lgp.experiments.toolbox import experiment_toolbox

    summary = experiment_toolbox(
        output,
        **common,
        on_event=lambda event: echo(f"toolbox: {event}", err=True),
        command=page_command("lgp"),
    )
    if as_json:
        print_json(summary)
    else:
        from lgp.console import show_toolbox
        from reba.terminal import console

        show_toolbox(console(), summary)
        echo(f"results are in {output}: report.html, summary.json, runs.parquet, ergonomic/, non-ergonomic/")


@cli.command(epilog="Example: lgp plan screwdriver -o plan/ && lgp page plan/")
@click.argument("folder", metavar="DIR")
@click.option(
    "-o",
    "--output",
    type=output_folder(*PAGE_FILES),
    metavar="OUT",
    help="Folder of the page; `page` in DIR by default.",
)
@click.option("--pictures/--no-pictures", default=True, help="Also render images and films for browsers without WebGL.")
@json_option
def page(folder: str, output: str | None, pictures: bool, as_json: bool) -> None:
    """Write the presentation of the plan in DIR for the worker: each action as text, image and animation."""
    from lgp.page.page import write_page
    from lgp.plan_record import Plan

    plan = Plan.load(folder)
    index = write_page(plan, Path(folder) / "page" if output is None else output, pictures=pictures)
    parts = [index, *(file for name in (ASSETS, PICTURES) for file in (index.parent / name).glob("*"))]
    size = sum(file.stat().st_size for file in parts if file.is_file())
    if as_json:
        print_json({"output": str(index), "actions": list(plan.actions), "bytes": size})
    else:
        echo(f"{index}: {len(plan.actions)} actions, {size / 1e6:.1f} MB; open it in any browser")


@cli.command(epilog="Example: lgp scenes --json")
@json_option
def scenes(as_json: bool) -> None:
    """List the shipped scenes."""
    titles = {name: load_scene(name).title for name in shipped_scenes()}
    if as_json:
        print_json(titles)
        return
    from reba.terminal import console

    for name, title in titles.items():
        console().print(f"{name}: {title}")


cli.add_command(study)
cli.add_command(simulate_study)
cli.add_command(run_command)
cli.add_command(improve)


def _height(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except (ValueError, OverflowError) as error:
        raise LgpError(f"--height is {text!r}, expected TABLE=METRES; write left=0.9 for example") from error


def _read(file: str) -> list[str]:
    try:
        return read_settings(file).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise LgpError(f"{file}: cannot be read ({error}); give a text file with one action per line") from error


def _draw(file: str, plan: Any) -> None:
    from lgp.search.tree_figure import draw
    from lgp.svg import with_generator

    labels = plan.concurrent["one_at_a_time"]["actions"] if plan.concurrent else plan.actions
    best = next((node.skeleton for node in plan.tree if _labels(node) == tuple(labels)), ())
    drawing = with_generator(draw(plan.tree, best))
    write_atomic(file, lambda part: write_text(part, drawing))


def _labels(node: Any) -> tuple[str, ...]:
    return tuple(action.at(step + 1) for step, action in enumerate(node.skeleton))


def main() -> None:
    """Run the command line with the exit codes of `reba.command_line`."""
    run(cli, "lgp", fit="plan")
