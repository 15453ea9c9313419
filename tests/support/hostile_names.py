"""Names that obey nobody: what a terminal would do, what a page would run, and files that have such names inside."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import lgp
from lgp.scene.scene_file import read_scene
from tests.support import mcap_builder as build
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.studies import log

CODES = "\x1b[35;45m\x1b[2J\x1b]0;title\x07\x08\x0b\x7f\x9b31m\u202e\u2066\u200b"
"""Colours that no command of ours has, an empty screen, a new title, a bell, other directions."""
NAME = f"left{CODES}[red]arm[/red][b] :boom: {{0}} 50%"
FORGED = f"{NAME}\nreba: forged\tline\rreba: forged"
FILE = NAME.replace("/", "").replace("\x9b", "\udc9b") + "\nreba: forged"
"""A name of a file: no slash, and a byte that is not UTF-8."""

MARKUP = (
    '<img src=x onerror="window.bad=1"></script><script>window.bad=2</script><!-- "onmouseover="window.bad=3" '
    "'{{7*7}} ${7*7} <b class=hostile>bold</b> <a href=javascript:window.bad=4>x</a> ]]> &lt; \u2028" + CODES
)
"""What a page would run or show as something else."""


@cache
def plan(words: str) -> lgp.Plan:
    """Return a plan of a human whose scene, box and table have hostile names."""
    box, table = f"{words} box", f"{words} table"
    scene: dict[str, Any] = {
        **HUMAN_ONLY,
        "title": words,
        "initial": [f"on_table({box})", "free(human.right_hand)"],
        "goal": [f"grasped(human.right_hand, {box})"],
        "tables": {table: HUMAN_ONLY["tables"]["near"]},
        "objects": {box: {**HUMAN_ONLY["objects"]["box"], "on": f"table.{table}"}},
    }
    return lgp.plan(read_scene(scene, words), cost=None, slices=4)


def scene(path: Path, words: str) -> Path:
    """Write the scene of a human whose box and table have hostile names."""
    box, table = quoted(f"{words} box"), quoted(f"{words} table")
    path.write_text(
        f"""title = {quoted(words)}
domain = "screwdriver"
slices = 3
initial = [{quoted(f"on_table({words} box)")}, "free(human.right_hand)"]
goal = [{quoted(f"grasped(human.right_hand, {words} box)")}]
[human]
hands = ["left_hand", "right_hand"]
position = [0.3, -0.2]
yaw = 40
[tables.{table}]
position = [0.5, 0.1]
yaw = 20
size = [0.6, 0.4]
height = 0.8
[objects.{box}]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = {quoted(f"table.{words} table")}
slide = 0.1
""",
        encoding="utf-8",
    )
    return path


def quoted(text: str) -> str:
    """Return a text as TOML and JSON write it."""
    return json.dumps(text).replace("\x7f", "\\u007f")


def study(folder: Path, words: str) -> Path:
    """Write the manifest of a study, whose participants and conditions have hostile names, with its recordings."""
    rows = ["file,participant,condition"]
    cell = words.replace('"', '""').replace("\x0b", "").replace("\u2028", "")
    for person in (1, 2, 3):
        for condition, trunk in (("calm", 10.0), ("hasty", 50.0 + person)):
            file = log(folder / f"{person}{condition}.mcap", None, trunk)
            rows.append(f'{file.name},"{cell}{person}","{cell}{condition}"')
    rows.append(f',"{cell}4","{cell}calm"')
    manifest = folder / "who.csv"
    manifest.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return manifest


def joint_table(path: Path, joints: tuple[str, ...]) -> Path:
    """Write a table of joint values whose columns have hostile names before the joints."""
    time = np.arange(0, 4, 0.1)
    columns = {"time": time, NAME: np.sin(time), f"{NAME} words": "no number" + CODES}
    pd.DataFrame({**columns, **{name: 0.2 * np.sin(time) for name in joints}}).to_csv(path, index=False)
    return path


def posture_table(path: Path, **words: str) -> Path:
    """Write a posture table with further columns of words."""
    time = np.arange(0, 4, 0.1)
    angles = {"trunk_flexion": 40 + 30 * np.sin(time), "neck_flexion": 10.0, "trunk_flexionn" + CODES: 1.0}
    pd.DataFrame({"time": time, **angles, **words}).to_csv(path, index=False)
    return path


def mcap(path: Path, joints: tuple[str, ...]) -> Path:
    """Write joint states: topic, type and joints with hostile names."""
    names = (*joints, FORGED)
    rows = [
        (1, moment, build.joint_state(moment, names, np.full(len(names), 0.01 * number)))
        for number, moment in enumerate(range(build.EPOCH_NS, build.EPOCH_NS + 60 * build.STEP_NS, build.STEP_NS))
    ]
    definitions = (
        build.schema(1, build.JOINT_STATE, "ros2msg", build.definition(build.JOINT_STATE)),
        build.channel(1, 1, FORGED, "cdr"),
        build.schema(2, FORGED, FORGED, b""),
        build.channel(2, 2, f"{FORGED} other", FORGED),
    )
    path.write_bytes(build.build(build.Plan((tuple(rows),), definitions)))
    return path


def json_lines(path: Path) -> Path:
    """Write rows of the posture table as `reba live -` reads them, with hostile keys and a line that is no JSON."""
    rows = [json.dumps({"time": 0.1 * n, "trunk_flexion": 30.0, FORGED: 1.0}) for n in range(60)]
    path.write_text("\n".join([*rows, NAME.replace("\n", "")]) + "\n", encoding="utf-8")
    return path
