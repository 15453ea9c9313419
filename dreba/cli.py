"""The `dreba` command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import click

import reba
from dreba.cells import WEIGHTS
from dreba.domain import DOMAINS, Domain, domain_of
from dreba.errors import ModelError, SampleError
from dreba.evaluate import PUBLISHED, fit_to
from dreba.evaluate import evaluate as evaluate_model
from dreba.files import load, models
from dreba.model import KINDS, Surrogate
from dreba.poses import Poses, read_poses
from dreba.sample import FACTOR_NAMES
from dreba.sample import sample as draw
from reba.errors import did_you_mean
from reba.shell import GROUP, command_line, console, json_option, print_json, run

HELD_OUT: Final = 1
EVALUATION: Final = 2
"""Second numbers of the seeds of held-out poses and of poses for evaluation: no fit ever sees them."""
HIGHEST: Final = 99
"""End of a range of classes: enough to name the first one that is no REBA score."""
FEWEST: Final = 200
"""Poses that a fit from a file needs; below, errors per class mean nothing."""
HELD_SHARE: Final = 0.2
"""Share of the poses of a file that a fit does not see."""


def drawing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say which poses are drawn."""
    for option in (
        click.option("--adjustments/--no-adjustments", default=True, help="Twists, side bends, abduction and so on."),
        click.option("--arms", default="both", type=click.Choice(["both", "left", "right"]), help="Arms that move."),
        click.option("--factors", default="", metavar="LIST", help=f"Drawn as well: {','.join(FACTOR_NAMES)}."),
        click.option("--stratified", is_flag=True, help="Fill part scores evenly to within one pose."),
        click.option("--weights", default="bins", type=click.Choice(WEIGHTS), help="Likeliness inside a class."),
        click.option("--domain", default=None, metavar="NAME|FILE.toml", help=f"Joint limits: {', '.join(DOMAINS)}."),
        click.option("--seed", default=0, type=click.IntRange(min=0), show_default=True, help="Seed of the draws."),
        click.option("--classes", default="1:10", metavar="A:B|LIST", show_default=True, help="REBA scores to fill."),
        click.option("-n", "--number", "n", default=10_000, type=int, show_default=True, help="Number of poses."),
    ):
        command = option(command)
    return command


poses_option = click.option(
    "--poses", "poses_file", metavar="FILE", help="Poses of `dreba sample`, or any recording, instead of drawing."
)


@click.group(context_settings=GROUP)
@click.version_option(reba.__version__, prog_name="dreba")
def cli() -> None:
    """Differentiable surrogates of the REBA posture score.

    \b
    Start with:  dreba fit -o model.json      poses drawn, model fitted, error per REBA class
    Then:        dreba compare model.json     beside the published model
    """


@cli.command(epilog="Example: dreba sample -n 100000 --classes 1:10 --seed 1 -o poses.parquet")
@drawing_options
@click.option("-o", "--output", required=True, metavar="POSES.parquet", help="File to write.")
@json_option
def sample(output: str, as_json: bool, **given: Any) -> None:
    """Draw poses evenly over REBA classes."""
    _apart({"-o": output}, given["domain"])
    if Path(output).suffix.lower() != ".parquet":
        raise SampleError(f"{output}: poses are written as Parquet; choose a name ending in .parquet")
    poses = _draw(given, given["seed"])
    poses.save(output)
    if as_json:
        counts = {str(score): count for score, count in poses.counts.items()}
        print_json({"output": output, "n": len(poses), "classes": counts, "provenance": poses.provenance})
    else:
        click.echo(f"{output}: {len(poses):,} poses, {len(poses.counts)} classes, seed {given['seed']}")


@cli.command(epilog="Example: dreba fit --kind quadratic -n 20000 --seed 1 -o model.json --report model.html")
@click.option("--kind", default="quadratic", show_default=True, metavar="KIND", help="Kind of model.")
@click.option("--option", "options", multiple=True, metavar="NAME=VALUE", help="A parameter of the kind, repeatable.")
@poses_option
@drawing_options
@click.option("-o", "--output", required=True, metavar="MODEL.json", help="File to write.")
@click.option("--report", metavar="FILE.html", help="Write a self-contained HTML report.")
@json_option
def fit(
    kind: str, options: tuple[str, ...], poses_file: str | None, output: str, report: str | None, as_json: bool,
    **given: Any,
) -> None:  # fmt: skip
    """Fit a model to drawn poses, or to your own with every REBA class weighing the same."""
    _apart({"-o": output, "--report": report}, poses_file, given["domain"])
    model = _model(kind, options, given["domain"])
    weights = None
    if poses_file is None:
        train, held_out = _draw(given, given["seed"]), _draw(given, (given["seed"], HELD_OUT))
    else:
        import numpy as np

        train, held_out = _enough(read_poses(poses_file), poses_file).split(
            HELD_SHARE, np.random.default_rng(given["seed"])
        )
        weights = train.balancing_weights()
    fit_to(model, train, held_out, weights, command=command_line("dreba"))
    model.save(output)
    _show_evaluation(model, output, held_out, report, as_json, None)
    click.echo(f"written: {', '.join(filter(None, (output, report)))}", err=True)


@cli.command(epilog="Example: dreba evaluate model.json --poses poses.parquet")
@click.argument("model", metavar="MODEL")
@poses_option
@drawing_options
@click.option("--temperature", type=float, default=None, metavar="DEG", help="For kinds that have one.")
@click.option("--report", metavar="FILE.html", help="Write a self-contained HTML report.")
@json_option
def evaluate(
    model: str, poses_file: str | None, temperature: float | None, report: str | None, as_json: bool, **given: Any
) -> None:
    """RMSE, bias and count per REBA class, on poses no fit has seen. MODEL is a file or a shipped model's name."""
    _apart({"--report": report}, model, poses_file, given["domain"])
    found = load(model)
    _show_evaluation(found, model, _unseen(found, poses_file, given), report, as_json, temperature)


def _show_evaluation(
    model: Surrogate, name: str, poses: Poses, report: str | None, as_json: bool, temperature: float | None
) -> None:
    result = evaluate_model(model, poses, temperature)
    if report is not None:
        from dreba.report import write_report

        write_report(report, model, poses, name=Path(name).name, command=command_line("dreba"), temperature=temperature)
    if as_json:
        print_json(result.to_dict())
        return
    from dreba.terminal import show_evaluation

    show_evaluation(console(), name, result)


def _apart(outputs: dict[str, str | None], *inputs: str | None) -> None:
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


def _draw(given: dict[str, Any], rng: Any) -> Poses:
    """Return the poses that `drawing_options` ask for."""
    names = [name.strip() for name in given["factors"].split(",") if name.strip()]
    return draw(
        given["n"],
        _classes(given["classes"]),
        domain=given["domain"] or "human",
        rng=rng,
        weights=given["weights"],
        stratified=given["stratified"],
        factors=names or None,
        adjustments=given["adjustments"],
        arms=given["arms"],
    )


def _unseen(model: Surrogate, poses_file: str | None, given: dict[str, Any]) -> Poses:
    """Return the poses of a file, or poses drawn from the model's own domain with a seed of their own."""
    if poses_file is not None:
        return read_poses(poses_file)
    if given["domain"] is None and model.about_.domain:
        given = {**given, "domain": Domain.from_dict(model.about_.domain)}
    return _draw(given, (given["seed"], EVALUATION))


def _enough(poses: Poses, path: str) -> Poses:
    if len(poses) < FEWEST:
        raise SampleError(f"{path}: {len(poses)} poses are too few to fit a model; give {FEWEST} or more")
    return poses


def _classes(text: str) -> list[int]:
    """Return the scores of "1:10" or "1,2,5"."""
    try:
        low, colon, high = text.partition(":")
        return (
            list(range(int(low), min(int(high), HIGHEST) + 1)) if colon else [int(score) for score in text.split(",")]
        )
    except ValueError as error:
        raise SampleError(f"classes are {text!r}; expected FIRST:LAST or a list such as 1,2,5") from error


def _model(kind: str, options: tuple[str, ...], domain: str | None) -> Surrogate:
    """Return a model that is not fitted yet, with its parameters set."""
    if kind not in KINDS:
        raise ModelError(f"kind {kind!r} is unknown{did_you_mean(kind, KINDS)}; known: {', '.join(sorted(KINDS))}")
    known = KINDS[kind]().get_params(deep=False)
    parameters: dict[str, Any] = {}
    if domain is not None and "domain" in known:
        domain_of(domain)
        parameters["domain"] = domain
    for text in options:
        name, equals, value = text.partition("=")
        if not equals or name not in known:
            near = did_you_mean(name, known)
            raise ModelError(f"option {text!r} is not NAME=VALUE of kind {kind!r}{near}; known: {', '.join(known)}")
        try:
            parameters[name] = json.loads(value)
        except json.JSONDecodeError:
            parameters[name] = value
    return KINDS[kind](**parameters)


@cli.command(epilog="Example: dreba compare model.json quadratic --tasks 20")
@click.argument("names", nargs=-1, metavar="MODEL...")
@poses_option
@drawing_options
@click.option(
    "--tasks", default=10, type=click.IntRange(min=0), show_default=True, help="Reach tasks to optimise; 0 for none."
)
@json_option
def compare(names: tuple[str, ...], poses_file: str | None, tasks: int, as_json: bool, **given: Any) -> None:
    """Models beside the published Table I: error, time, and the true REBA that optimising them leads to.

    All are given the same poses, which no fit has seen, and the same reach tasks. Without MODEL, all shipped models.
    """
    from dreba.comparison import compare as compare_models
    from dreba.comparison import enable

    loaded = {name: load(name) for name in names or models()}
    poses = read_poses(poses_file) if poses_file is not None else _draw(given, (given["seed"], EVALUATION))
    rows = compare_models(loaded, poses)
    reached = enable(loaded, tasks, seed=given["seed"]) if tasks else []
    if as_json:
        published = {str(score): rmse for score, rmse in PUBLISHED.items()}
        print_json({"published": published, "models": rows, "enabler": reached})
        return
    from dreba.terminal import show_comparison, show_enabler

    show_comparison(console(), rows)
    if reached:
        show_enabler(console(), reached)


@cli.command(epilog="Example: dreba export soft --to c --temperature 2 -o reba_soft.c")
@click.argument("model", metavar="MODEL")
@click.option("--to", "target", required=True, metavar="TARGET", help="c, casadi.")
@click.option("--temperature", type=float, default=None, metavar="DEG", help="For kinds that have one.")
@click.option("--name", default="dreba", show_default=True, help="Name of the function.")
@click.option(
    "-o", "--output", default=None, metavar="FILE", help="File to write; the name of the function if left out."
)
@json_option
def export(model: str, target: str, temperature: float | None, name: str, output: str | None, as_json: bool) -> None:
    """Write a model as a C99 function without dependencies, or as a CasADi function."""
    from dreba.export import export as export_model

    _apart({"-o": output}, model)
    written = export_model(load(model), target, output or name, temperature=temperature, name=name)
    if as_json:
        print_json({"model": model, "to": target, "output": str(written)})
    else:
        click.echo(f"written: {written}")


def main() -> None:
    """Run the command; errors are one line on standard error."""
    run(cli, "dreba")
