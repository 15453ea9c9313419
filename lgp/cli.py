"""The `lgp` command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lgp.errors import LgpError
from lgp.execution.commands import run_command
from lgp.planner import COST
from lgp.planner import plan as make_plan
from lgp.scene.scene_file import load_scene, shipped_scenes
from lgp.study.commands import simulate_study, study
from reba._version import __version__
from reba.command_line import GROUP, command_line, console, json_option, print_json, run, where_options


@click.group(context_settings=GROUP)
@click.version_option(__version__, prog_name="lgp")
def cli() -> None:
    """Plan who does what and how everybody moves, with ergonomics.

    \b
    Start with:  lgp plan screwdriver        a shipped scene, or the path of your own
    """


@cli.command(epilog="Example: lgp plan screwdriver -o plan/ --tree tree.svg")
@click.argument("scene")
@click.option("--cost", metavar="MODEL.json|NAME", help="dREBA model of the ergonomic cost; `convex` by default.")
@click.option("--no-ergonomics", is_flag=True, help="Plan by accelerations alone.")
@click.option("--no-collisions", is_flag=True, help="Let bodies pass through each other.")
@click.option("--sequence", metavar="FILE", help="Plan the motion of these actions, one a line, instead of searching.")
@click.option("--depth", type=click.IntRange(1, 40), help="Longest sequence; the scene's by default.")
@click.option("--seconds", type=click.FloatRange(0, min_open=True), help="Stop the search after this time.")
@click.option("--height", "heights", multiple=True, metavar="TABLE=M", help="Height of a table [m]; may be repeated.")
@click.option("-o", "--output", metavar="DIR", help="Write plan.json, path.parquet and postures.parquet there.")
@click.option("--tree", metavar="FILE.svg", help="Draw the searched tree.")
@json_option
def plan(
    scene: str,
    cost: str | None,
    no_ergonomics: bool,
    no_collisions: bool,
    sequence: str | None,
    depth: int | None,
    seconds: float | None,
    heights: tuple[str, ...],
    output: str | None,
    tree: str | None,
    as_json: bool,
) -> None:
    """Plan a SCENE: the name of a shipped one, or a TOML file."""
    if cost is not None and no_ergonomics:
        raise LgpError("--cost and --no-ergonomics were both given; choose one of them")
    if tree is not None and sequence is not None:
        raise LgpError("--tree was given with --sequence, which searches no tree; leave one of them out")
    loaded = load_scene(scene).with_heights(dict(_height(text) for text in heights))
    lines = None if sequence is None else _read(sequence)
    found = make_plan(
        loaded,
        None if no_ergonomics else cost or COST,
        sequence=lines,
        depth=depth,
        seconds=float("inf") if seconds is None else seconds,
        collisions=not no_collisions,
    )
    if output is not None:
        found.save(output)
    if tree is not None:
        _draw(tree, found)
    summary: dict[str, Any] = {**found.summary(), "output": output}
    if as_json:
        print_json(summary)
    elif found.feasible:
        from lgp.console import show_plan

        show_plan(console(), summary)
    if not found.feasible:
        raise LgpError(f"{loaded.name}: no plan: {found.reason}")


@cli.command(epilog="Example: lgp experiment screwdriver --runs 100 --jobs 2 -o results/")
@click.argument("name", type=click.Choice(["screwdriver", "toolbox"]))
@click.option("--runs", default=100, type=click.IntRange(min=1), show_default=True, help="Draws of the table heights.")
@click.option("--seed", default=0, type=click.IntRange(min=0), show_default=True, help="Seed of all draws.")
@click.option("--initial", default="rest", type=click.Choice(["rest", "random"]), help="First posture of the human.")
@click.option("--cost", default=COST, metavar="MODEL.json|NAME", show_default=True, help="dREBA model.")
@click.option(
    "--sensitivity",
    default=0,
    type=click.IntRange(min=0),
    metavar="RUNS",
    help="Also vary each free choice of the scene by 20 %, with so many runs of each.",
)
@click.option("--collisions", is_flag=True, help="Keep bodies apart, as `lgp plan` does: several times as long.")
@where_options
@click.option("-o", "--output", required=True, metavar="DIR", help="Results; an unfinished experiment goes on there.")
@json_option
def experiment(
    name: str,
    runs: int,
    seed: int,
    initial: str,
    cost: str,
    sensitivity: int,
    collisions: bool,
    jobs: int,
    scheduler: str | None,
    output: str,
    as_json: bool,
) -> None:
    """Run an experiment of the paper again: tables, figures and tests, ours beside theirs.

    \b
    screwdriver   which of three tables, over many draws of their heights
    toolbox       which order of actions; one scene, so only --cost, -o and --json count
    """
    if name == "toolbox":
        _toolbox(output, cost, as_json)
        return
    from lgp.experiments.screwdriver_experiment import experiment_screwdriver

    def progress(done: int, wanted: int) -> None:
        click.echo(f"{name}: {done} of {wanted} runs", err=True)

    summary = experiment_screwdriver(
        output,
        runs=runs,
        seed=seed,
        initial=initial,
        cost=cost,
        jobs=jobs,
        scheduler=scheduler,
        collisions=collisions,
        sensitivity=sensitivity,
        progress=progress,
        on_event=lambda event: click.echo(f"{name}: {event}", err=True),
        command=command_line("lgp"),
    )
    if as_json:
        print_json(summary)
    else:
        click.echo(f"results are in {output}: report.html, summary.json, runs.parquet, paths.parquet")


def _toolbox(output: str, cost: str, as_json: bool) -> None:
    from lgp.experiments.toolbox import experiment_toolbox

    summary = experiment_toolbox(
        output,
        cost=cost,
        on_event=lambda event: click.echo(f"toolbox: {event}", err=True),
        command=command_line("lgp"),
    )
    if as_json:
        print_json(summary)
    else:
        from lgp.console import show_toolbox

        show_toolbox(console(), summary)
        click.echo(f"results are in {output}: report.html, summary.json, runs.parquet, ergonomic/, non-ergonomic/")


@cli.command(epilog="Example: lgp plan screwdriver -o plan/ && lgp page plan/")
@click.argument("folder", metavar="DIR")
@click.option("-o", "--output", metavar="OUT", help="Folder of the page; `page` in DIR by default.")
@click.option("--pictures/--no-pictures", default=True, help="Also draw stills and films for where WebGL is missing.")
@json_option
def page(folder: str, output: str | None, pictures: bool, as_json: bool) -> None:
    """Write the presentation of the plan in DIR for the worker: what to do next, shown and played."""
    from lgp.page.page import write_page
    from lgp.plan_record import Plan

    found = Plan.load(folder)
    index = write_page(found, Path(folder) / "page" if output is None else output, pictures=pictures)
    size = sum(file.stat().st_size for file in index.parent.rglob("*") if file.is_file())
    if as_json:
        print_json({"output": str(index), "actions": list(found.actions), "bytes": size})
    else:
        click.echo(f"{index}: {len(found.actions)} actions, {size / 1e6:.1f} MB; open it in any browser")


@cli.command()
@json_option
def scenes(as_json: bool) -> None:
    """List the shipped scenes."""
    found = {name: load_scene(name).title for name in shipped_scenes()}
    if as_json:
        print_json(found)
        return
    for name, title in found.items():
        click.echo(f"{name}: {title}")


cli.add_command(study)
cli.add_command(simulate_study)
cli.add_command(run_command)


def _height(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError as error:
        raise LgpError(f"--height {text!r}: expected TABLE=METRES, as in left=0.9") from error


def _read(file: str) -> list[str]:
    try:
        return Path(file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise LgpError(f"{file}: cannot be read ({error}); give a text file with one action a line") from error


def _draw(file: str, found: Any) -> None:
    from lgp.search.tree_figure import draw

    best = next((node.skeleton for node in found.tree if _labels(node) == found.actions), ())
    try:
        Path(file).write_text(draw(found.tree, best), encoding="utf-8")
    except OSError as error:
        raise LgpError(f"{file}: cannot be written ({error.strerror or error}); give another file") from error


def _labels(node: Any) -> tuple[str, ...]:
    return tuple(action.at(step + 1) for step, action in enumerate(node.skeleton))


def main() -> None:
    """Run the command line; exit codes are in `reba.command_line`."""
    run(cli, "lgp")
