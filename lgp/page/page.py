"""A plan as a folder for any browser: the presentation, its libraries, and pictures for browsers without WebGL."""

from __future__ import annotations

import hashlib
import json
import shutil
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np

from lgp.errors import LgpError
from lgp.files import ASSETS, PAGE, PAGE_FILES, PICTURE_FILES, PICTURES
from lgp.motion import Motion
from lgp.page.pack import packed
from lgp.page.pictures import write_pictures
from lgp.page.sentences import Instruction, instructions, person_in_words
from lgp.page.steps import with_steps
from lgp.page.view import SceneAnimation, scene_animation
from lgp.plan_record import Plan
from lgp.scene.model import Scene
from reba.arrays import Array, Indices
from reba.checks import PATH, YES_NO, accepts, instance
from reba.extras import missing
from reba.files import write_folder, write_text
from reba.method.tables import ACTION_LEVELS, LEVEL_OF
from reba.open_file import read_settings
from reba.outputs import FolderOutput, check_outputs
from reba.report.labels import LEVEL_COLOURS, TEXT_ON
from reba.report.page import read, template

NARROW = 3.0
"""[%] Narrower spans of the ribbon have no number."""
RING = 0.08
"""[m] Smallest radius of the ring around the object of an action."""
SCRIPTS = ("stage.js", "player.js", "live.js")


@accepts(LgpError, plan=instance("what lgp.plan returns", Plan), folder=PATH, pictures=YES_NO)
def write_page(plan: Plan, folder: str | Path, *, pictures: bool = True) -> Path:
    """Write the presentation of a plan.

    The same plan gives the same files. Served over HTTP, the page follows a running plan: it listens to `events`
    beside it, server-sent events whose data are `{"action": number from 0 or null, "state": "waiting" | "running" |
    "done" | "failed" | "finished", "text": "...", "time": seconds, "plan": number}`; it reloads when `plan`
    changes.

    Args:
        plan: feasible.
        folder: created if it does not exist; other files in it stay. A former page there is replaced when this one is
            complete.
        pictures: also draw stills and films for browsers without WebGL.

    Returns:
        The page, `index.html` in the folder.

    Raises:
        LgpError: the plan is infeasible, a package is missing, or the folder cannot be written.
    """
    check_packages()
    check_outputs(FolderOutput(folder, PAGE_FILES), error=LgpError)
    motion = Motion(plan)
    if not plan.actions:
        raise LgpError(f"{plan.scene.name}: the plan has no actions, the goal holds already; give a plan with actions")
    animation = scene_animation(motion)
    ends = np.append(0, motion.phases.ends + 1)
    lines = with_steps(instructions(motion.phases), motion.world, motion.path[ends])

    def write(part: Path) -> None:
        assets = part / ASSETS
        assets.mkdir()
        for name, file in library_files().items():
            shutil.copyfile(file, assets / name)
        for name in ("page.css", *SCRIPTS):
            write_text(assets / name, read("lgp.page", f"template/{name}"))
        data = _script({"view": packed(animation), **_facts(plan, animation, lines)})
        write_text(assets / "plan.js", data)
        if pictures:
            write_pictures(animation, part / PICTURES)
        write_text(part / PAGE, _html(plan, lines, pictures, data))

    write_folder(folder, write, last=PAGE, stale=PICTURE_FILES, error=LgpError)
    return Path(folder) / PAGE


def is_page_of(plan: Plan, folder: str | Path) -> bool:
    """Return whether the page in a folder is one of this plan, and not of one that was there before."""
    try:
        return f'<meta name="plan" content="{plan.digest}">' in read_settings(Path(folder) / PAGE)
    except (OSError, UnicodeDecodeError):
        return False


def _script(data: dict[str, Any]) -> str:
    """Return data as a script: pages opened from a file may not read data files."""
    return f"window.PLAN = {json.dumps(data, separators=(',', ':'), allow_nan=False)};\n"


def _facts(plan: Plan, animation: SceneAnimation, lines: tuple[Instruction, ...]) -> dict[str, Any]:
    """Return the data of the player beside the animation: what is done in each phase, the phase of each action, and
    score spans."""
    return {
        "phases": list(plan.phase_of),
        "actions": [
            {
                "text": line.text,
                "you": line.you,
                "who": " and ".join(dict.fromkeys(one.who for one in (line, *line.beside) if one.you)),
                "frame": animation.frames.index(line.object_name),
                "radius": max(RING, round(0.6 * max(plan.scene.objects[line.object_name].size), 3)),
            }
            for line in lines
        ],
        "people": [
            [
                {"start": run.start, "end": run.end, "score": run.score, "risk": risk(run.level), "colour": run.colour}
                for run in spans
            ]
            for spans in score_spans(plan).values()
        ],
    }


def _html(plan: Plan, lines: tuple[Instruction, ...], pictures: bool, data: str) -> str:
    total = float(plan.time[-1])
    return template("lgp.page", "template/index.html").render(
        title=plan.scene.name.replace("_", " ").capitalize(),
        lines=lines,
        labels=plan.actions,
        lead=_lead(plan.scene, len(lines)),
        people=_people(plan),
        marks=_marks(plan.durations),
        levels=[(risk(level), colour) for level, colour in enumerate(LEVEL_COLOURS)],
        seconds=total,
        scripts=SCRIPTS,
        plan=plan.digest,
        # A new address of the data, so that browsers do not reuse cached data of another plan.
        digest=hashlib.sha256(data.encode()).hexdigest()[:12],
        assets=ASSETS,
        pictures=PICTURES if pictures else "",
    )


def _marks(durations: Sequence[float]) -> list[tuple[float, float]]:
    """Return where each step begins on the ribbon and how wide it is [%]: over the scores of its time.

    >>> _marks((2.0, 6.0))
    [(0.0, 25.0), (25.0, 75.0)]
    """
    ends = 100.0 * np.cumsum(durations) / sum(durations)
    starts = np.append(0.0, ends[:-1])
    return [(round(start, 3), round(end - start, 3)) for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


def _lead(scene: Scene, steps: int) -> str:
    """Return what the page is about: who does what."""
    robots = "the robot does" if len(scene.robots) <= 1 else "the robots do"
    who = [robots] if scene.robots else []
    who += ["what you do" if len(scene.humans) == 1 else "what each of you does"] if scene.humans else []
    return f"What {' and '.join(who).removeprefix('what ')}, in {steps} step{'' if steps == 1 else 's'}."


def _people(plan: Plan) -> list[dict[str, Any]]:
    """Return name, mean and largest score, and bars of each person; the only one needs no name."""
    total, figures = float(plan.time[-1]), plan.summary()["reba"]["people"]
    return [
        {
            "name": person_in_words(name) if len(figures) > 1 else "",
            **figures[name],
            "bars": [_bar(run, total) for run in spans],
        }
        for name, spans in score_spans(plan).items()
    ]


def _bar(run: ScoreSpan, total: float) -> dict[str, Any]:
    width = 100.0 * (run.end - run.start) / total
    return {
        "left": round(100.0 * run.start / total, 3),
        "width": round(width, 3),
        "number": str(run.score) if width >= NARROW else "",
        "height": round(38 + 62 * (run.score - 1) / 14, 1),
        "run": run,
        "risk": risk(run.level),
    }


TABLE = Path(__file__).parent / "data" / "libraries.toml"


@cache
def table() -> dict[str, Any]:
    """Return the table libraries.toml (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def check_packages(modules: Mapping[str, str] | None = None) -> None:
    """Check that the packages of a page are installed, by default those of libraries.toml (module -> package).

    Raises:
        LgpError: a package is missing.
    """
    for module, package in (table()["modules"] if modules is None else modules).items():
        try:
            import_module(module)
        except ImportError as error:
            raise missing(package, "the page", "page") from error
    library_files()


def library_files() -> dict[str, Path]:
    """Return name in the page -> file of a library.

    Raises:
        LgpError: its package is missing, or has no such file.
    """
    files = {}
    for library in table()["libraries"]:
        try:
            distribution = metadata.distribution(library["package"])
        except metadata.PackageNotFoundError as error:
            raise missing(library["package"], "the page", "page") from error
        carried = sorted(str(file) for file in distribution.files or ())
        for name, pattern in library["files"].items():
            inside = [file for file in carried if fnmatch(file, pattern)]
            if not inside:
                raise LgpError(
                    f"{library['package']} {distribution.version} has no {pattern}; install {library['works']}"
                )
            files[name] = Path(str(distribution.locate_file(inside[-1])))
    return files


@dataclass(frozen=True)
class ScoreSpan:
    """Successive slices of one score: start and end [s], score, action level, its colour and that of text on it."""

    start: float
    end: float
    score: int
    level: int
    colour: str
    ink: str


def score_spans(plan: Plan) -> dict[str, tuple[ScoreSpan, ...]]:
    """Return person -> spans of equal REBA score in a plan; slices begin where the former one ends."""
    time = np.concatenate([[0.0], plan.time])
    return {name: _spans(np.asarray(one.reba().reba, dtype=int), time) for name, one in plan.people.items()}


def _spans(total: Indices, time: Array) -> tuple[ScoreSpan, ...]:
    firsts = np.flatnonzero(np.diff(total, prepend=-1))
    lasts = np.append(firsts[1:], len(total))
    return tuple(
        _span(float(time[first]), float(time[last]), int(total[first]))
        for first, last in zip(firsts, lasts, strict=True)
    )


def risk(level: int) -> str:
    """Return the words of an action level."""
    return ACTION_LEVELS[level][0]


def _span(start: float, end: float, score: int) -> ScoreSpan:
    level = int(LEVEL_OF[score])
    colour = LEVEL_COLOURS[level]
    return ScoreSpan(round(start, 6), round(end, 6), score, level, colour, TEXT_ON.get(colour, "#1b2430"))
