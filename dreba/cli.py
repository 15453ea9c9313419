"""The `dreba` command: sample, fit, evaluate, compare, export."""

from __future__ import annotations

from reba.interrupts import enter

if __name__ == "__main__":
    enter("dreba.cli")  # under its own name, and before the other imports

import os
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from dreba.domain import Domain, domain_of
from dreba.errors import RadiansWarning, SampleError
from dreba.options import (
    CLASSES,
    as_paper,
    draw_poses,
    drawing_options,
    drawn_domain,
    hold_of,
    joints_of,
    joints_option,
    poses_options,
    reach_tasks_of,
    refuse_drawing,
    unfitted,
)
from dreba.sampling.poses import Poses, read_poses
from reba._version import __version__
from reba.command_line import (
    GROUP,
    Group,
    Number,
    OutputType,
    command_line,
    echo,
    json_option,
    output_file,
    parallel_options,
    print_json,
    print_notes,
    run,
)
from reba.outputs import FileOutput, check_outputs
from reba.posture.columns import COLUMNS

if TYPE_CHECKING:
    from dreba.surrogates.base import Surrogate

HELD_OUT: Final = 1
EVALUATION: Final = 2
FACTORS: Final = 3
"""Second words of the seeds of held-out and evaluation poses and of factors, which keep them independent of the
training poses."""
MIN_POSES: Final = 200
"""Least number of poses of a file to fit: the 20 % held out of 200 are about four for each class."""
HELD_OUT_SHARE: Final = 0.2
"""Share of the poses of a file held out from the fit, the usual 80:20 split."""


@click.group(cls=Group, context_settings=GROUP)
@click.version_option(__version__, prog_name="dreba")
def cli() -> None:
    """Differentiable surrogates of the REBA posture score.

    \b
    Start with:  dreba fit -o model.json   a model, and its error per REBA class
    Then:        dreba compare model.json  beside the published model
    """
    warnings.simplefilter("once", RadiansWarning)  # training and held-out poses would each warn


@cli.command(epilog="Example: dreba sample -n 100000 --classes 1:10 --seed 1 -o poses.parquet")
@drawing_options
@click.option(
    "-o", "--output", required=True, type=output_file(".parquet"), metavar="POSES.parquet", help="File to write."
)
@json_option
def sample(output: str, as_json: bool, **drawing: Any) -> None:
    """Draw random poses evenly over REBA classes."""
    poses = draw_poses(drawing, drawing["seed"])
    poses.save(output)
    if as_json:
        counts = {str(score): count for score, count in poses.counts.items()}
        print_json({"output": output, "n": len(poses), "classes": counts, "provenance": poses.provenance})
    else:
        echo(f"{output}: {len(poses):,} poses, {len(poses.counts)} classes, seed {drawing['seed']}")


@cli.command(epilog="Example: dreba fit --kind quadratic -n 20000 --seed 1 -o model.json --report model.html")
@click.option(
    "--kind",
    default="quadratic",
    show_default=True,
    metavar="KIND",
    help="Kind of model, such as quadratic, convex, soft or graduated.",
)
@click.option("--option", "options", multiple=True, metavar="NAME=VALUE", help="Parameter of the kind, repeatable.")
@click.option(
    "--as",
    "published",
    type=click.Choice(["paper"]),
    default=None,
    help="Settings nearest to the published Table I: domain paper, low classes weigh more, payload as equation (4).",
)
@poses_options
@joints_option
@drawing_options
@click.option("-o", "--output", required=True, type=output_file(), metavar="MODEL.json", help="File to write.")
@click.option("--report", type=output_file(), metavar="FILE.html", help="Write a self-contained HTML report.")
@json_option
def fit(
    kind: str, options: tuple[str, ...], published: str | None, poses_file: str | None, hold: str | None,
    joints: str | None, output: str, report: str | None, as_json: bool, **drawing: Any,
) -> None:  # fmt: skip
    """Fit a model to drawn poses, or to a recording with equal weight for every REBA class.

    Every fifth drawn pose, or every pose of a file, is repeated with a random load, coupling and activity, so that the
    model knows what these add.
    A recording without some angles needs --joints measured (a model of the measured angles) or --hold neutral.
    """
    import numpy as np

    from dreba.evaluation.evaluate import fit_to
    from dreba.sampling.loaded_poses import with_factors

    refuse_drawing(poses_file, "domain")
    if published == "paper":
        options = as_paper(kind, options, drawing)
    chosen, held_angles = joints_of(joints), hold_of(hold)
    weights = None
    if poses_file is None:
        own = drawn_domain(drawing["domain"], chosen, held_angles)
        model = unfitted(kind, options, own, chosen)
        drawing = {**drawing, "domain": own}
        train, held_out = draw_poses(drawing, drawing["seed"]), draw_poses(drawing, (drawing["seed"], HELD_OUT))
    else:
        domain = None if drawing["domain"] is None else domain_of(drawing["domain"])
        unfitted(kind, options, domain, None)  # wrong options are refused before a long file is read
        poses = _check_enough(_read(poses_file, chosen, held_angles), poses_file)
        drawn_from = Domain.from_dict(poses.provenance["domain"]) if "recording" not in poses.provenance else None
        columns = None if joints is None else tuple(poses.provenance.get("joints", COLUMNS))
        model = unfitted(kind, options, domain or drawn_from, columns)
        train, held_out = poses.split(HELD_OUT_SHARE, np.random.default_rng(drawing["seed"]))
        weights = train.balancing_weights()
    if not model.get_params().get("payload_only"):  # what such a model cannot learn would only disturb it
        train, weights = with_factors(train, np.random.default_rng((drawing["seed"], FACTORS)), weights)
    fit_to(model, train, held_out, weights, command=command_line("dreba"))
    model.save(output)
    _show_evaluation(model, output, held_out, report, as_json, None)
    echo(f"written: {', '.join(filter(None, (output, report)))}", err=True)


@cli.command(epilog="Example: dreba evaluate model.json --poses poses.parquet")
@click.argument("model", metavar="MODEL")
@poses_options
@drawing_options
@click.option(
    "--temperature",
    type=Number(0, 360, min_open=True),
    default=None,
    metavar="DEG",
    help="Smoothing temperature of soft and graduated models.",
)
@click.option("--report", type=output_file(), metavar="FILE.html", help="Write a self-contained HTML report.")
@json_option
def evaluate(
    model: str, poses_file: str | None, hold: str | None, temperature: float | None, report: str | None, as_json: bool,
    **drawing: Any,
) -> None:  # fmt: skip
    """RMSE, bias and count per REBA class on poses held out from the fit. MODEL is a file or a shipped model."""
    from dreba.evaluation.evaluate import check_temperature
    from dreba.surrogates.library import load

    surrogate = load(model)
    check_temperature(surrogate, temperature)
    poses = _evaluation_poses({model: surrogate}, poses_file, hold, drawing)
    _show_evaluation(surrogate, model, poses, report, as_json, temperature)


def _show_evaluation(
    model: Surrogate, name: str, poses: Poses, report: str | None, as_json: bool, temperature: float | None
) -> None:
    from dreba.evaluation.evaluate import evaluate

    result = evaluate(model, poses, temperature)
    if report is not None:
        from dreba.report import write_report

        write_report(model, poses, report, name=Path(name).name, command=command_line("dreba"), temperature=temperature)
    if as_json:
        print_json({**result.to_dict(), "setting": model.setting, "factors": list(model.factors_)})
        return
    from dreba.console import show_evaluation
    from reba.terminal import console

    show_evaluation(console(), name, result, model)


def _evaluation_poses(
    models_: dict[str, Surrogate], poses_file: str | None, hold: str | None, drawing: dict[str, Any]
) -> Poses:
    """Return the poses of a file, or poses drawn from the common domain of the models with the seed of evaluations."""
    refuse_drawing(poses_file)
    held_angles = hold_of(hold)
    if poses_file is not None:
        joints = {frozenset(model.joints_) for model in models_.values()}
        # Columns that a model does not have are held at the angles of its fit.
        own = tuple(next(iter(joints))) if len(joints) == 1 and joints != {frozenset(COLUMNS)} else None
        if own is not None and not isinstance(held_angles, str):
            train = next(iter(models_.values())).about_.provenance.get("train", {})
            held_angles = {**train.get("held", {}), **(held_angles or {})}
        return _read(poses_file, own, held_angles)
    if hold is not None:
        raise SampleError("--hold applies to poses of a file; add --poses, or leave it out")
    domains = [model.about_.domain for model in models_.values()]
    if drawing["domain"] is None and domains and domains[0] and all(own == domains[0] for own in domains):
        scores = sorted({int(score) for model in models_.values() for score in model.about_.rmse})
        classes = ",".join(map(str, scores)) or CLASSES
        return draw_poses(drawing, (drawing["seed"], EVALUATION), Domain.from_dict(domains[0]), classes)
    return draw_poses(drawing, (drawing["seed"], EVALUATION))


def _read(path: str, joints: Any, hold: Any) -> Poses:
    """Return the poses of a file and say what its reader noticed; it has warned of radians, so the model need not."""
    poses = read_poses(path, joints=joints, hold=hold)
    print_notes(poses.provenance.get("warnings", ()))
    if "recording" in poses.provenance:
        warnings.simplefilter("ignore", RadiansWarning)
    return poses


def _check_enough(poses: Poses, path: str) -> Poses:
    if len(poses) < MIN_POSES:
        raise SampleError(f"{path}: {len(poses)} poses are too few to fit a model; expected {MIN_POSES} or more")
    return poses


@cli.command(epilog="Example: dreba compare model.json quadratic --tasks bench:40")
@click.argument("names", nargs=-1, metavar="MODEL...")
@poses_options
@drawing_options
@click.option(
    "--tasks",
    default="wide:20",
    callback=reach_tasks_of,
    metavar="SPACE[:N]",
    show_default=True,
    help="Reach tasks: wide (floor to overhead) or bench, of each up to 80; 0 for none.",
)
@parallel_options
@json_option
def compare(
    names: tuple[str, ...], poses_file: str | None, hold: str | None, tasks: tuple[Any, int], jobs: int,
    scheduler: str | None, as_json: bool, **drawing: Any,
) -> None:  # fmt: skip
    """Models beside the published Table I: error, time, and the true REBA reached by minimising them.

    All models share held-out poses, reach tasks, starts, solver and budget. Without MODEL: all shipped models.
    """
    from dreba.evaluation.evaluate import compare as compare_models
    from dreba.evaluation.usefulness import enable
    from dreba.surrogates.library import load, models
    from dreba.surrogates.metrics import PUBLISHED

    loaded = {name: load(name) for name in names or models()}
    poses = _evaluation_poses(loaded, poses_file, hold, drawing)
    domain = str(poses.provenance.get("domain", {}).get("name", "unknown"))
    rows = compare_models(loaded, poses, jobs=jobs, scheduler=scheduler)
    other_domains = [f"{row['model']} ({row['domain']})" for row in rows if row["domain"] not in ("", domain)]
    if other_domains:
        echo(
            f"dreba: note: all models are evaluated in domain {domain}; fitted in another: {', '.join(other_domains)}; "
            "for errors there use --domain, or dreba evaluate for each model",
            err=True,
        )
    space, count = tasks
    enabler: dict[str, Any] = {"rows": []}
    if count:
        enabler = enable(loaded, count, seed=drawing["seed"], space=space, jobs=jobs, scheduler=scheduler)
        if enabler["left_out"]:
            echo(
                f"dreba: note: not minimised on reach tasks, which need all columns: {', '.join(enabler['left_out'])}",
                err=True,
            )
    if as_json:
        published = {str(score): rmse for score, rmse in PUBLISHED.items()}
        print_json({"published": published, "domain": domain, "models": rows, "enabler": enabler})
        return
    from dreba.console import show_comparison, show_enabler
    from reba.terminal import console

    show_comparison(console(), rows, domain)
    if enabler["rows"]:
        show_enabler(console(), enabler)


@cli.command(epilog="Example: dreba card quadratic busch2018")
@click.argument("names", nargs=-1, metavar="MODEL...")
@click.option("--usefulness", default=None, metavar="FILE.json", help="Output of `dreba compare --json`, for its rows.")
@click.option("-o", "--output", default=None, type=output_file(), metavar="FILE.md", help="Markdown file to write.")
@json_option
def card(names: tuple[str, ...], usefulness: str | None, output: str | None, as_json: bool) -> None:
    """What models prefer and know: minimum, true REBA there, columns without a lower bound, error, factors.

    Without MODEL: all shipped models.
    """
    from dreba.model_card import model_card, page, usefulness_table
    from dreba.surrogates.library import load, models
    from dreba.surrogates.serialization import write

    table = None if usefulness is None else usefulness_table(usefulness)
    cards = [model_card(load(name), name, table) for name in names or models()]
    text = page(cards)
    if output is not None:
        write(output, text)
    if as_json:
        print_json({"cards": cards, "output": output})
    elif output is None:
        if sys.stdout.isatty():
            from reba.terminal import console

            for line in text.splitlines():
                console().print(line)
        else:
            echo(text, nl=False, keep="\n")
    else:
        echo(f"written: {output}")


def _with_ending(name: str) -> FileOutput | None:
    """Return the file that is written, None where the target adds an ending to its name."""
    return FileOutput(name) if Path(name).suffix or os.path.isdir(name) or not name else None


@cli.command(epilog="Example: dreba export soft --to c --temperature 2 -o reba_soft.c")
@click.argument("model", metavar="MODEL")
@click.option("--to", "target", required=True, metavar="TARGET", help="Target: c (and C++), casadi, torch or jax.")
@click.option(
    "--temperature",
    type=Number(0, 360, min_open=True),
    default=None,
    metavar="DEG",
    help="Smoothing temperature of soft and graduated models.",
)
@click.option("--first", is_flag=True, help="First stage of a graduated model instead of its soft tables.")
@click.option("--name", default="dreba", show_default=True, help="Name of the exported function.")
@click.option("--map", "joint_map", default=None, metavar="FILE.toml", help="Your own joints, order, signs and unit.")
@click.option(
    "--hessian", type=click.Choice(["exact", "gauss-newton"]), default=None, help="Second derivatives too (C, CasADi)."
)
@click.option(
    "-o", "--output", default=None, type=OutputType(_with_ending), metavar="FILE",
    help="File to write; default: the name of the function.",
)  # fmt: skip
@json_option
def export(
    model: str, target: str, temperature: float | None, first: bool, name: str, joint_map: str | None,
    hessian: str | None, output: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Write a model as a function for C and C++, CasADi, PyTorch or JAX; none needs this package."""
    from dreba.export import ending_of, export_model, exported_files
    from dreba.surrogates.library import load

    outputs = exported_files(f"{name}{ending_of(target)}" if output is None else output, target)
    check_outputs(*map(FileOutput, outputs), inputs=[model, *([joint_map] if joint_map else [])])
    export_model(
        load(model), outputs[0], to=target, temperature=temperature, first=first, name=name, joint_map=joint_map,
        hessian=hessian,
    )  # fmt: skip
    if as_json:
        header = {"header": str(outputs[1])} if len(outputs) > 1 else {}
        print_json({"model": model, "to": target, "output": str(outputs[0]), **header})
    else:
        echo(f"written: {', '.join(map(str, outputs))}")


def main() -> None:
    """Run the command; an error is one line on standard error."""
    run(cli, "dreba")
