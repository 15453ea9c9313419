"""Try every arm of example-robot-data in a scene of its own, and write what came of it to docs/arms.md.

python docs/arms.py             all arms, one after another: 20 minutes to an hour
python docs/arms.py UR5 Kinova  those whose name contains one of the words

Each row is written as soon as its arm was tried, with the day; all other rows stay as they are.

Each arm takes a cube of 4 cm from a small table, as a scene says it: its URDF, the link that grasps, and the joints
that are no part of the arm locked. The table is where the arm reaches far with one of 200 random postures; what is
below and around the robot is left away. Where it finds no plan in a minute, four places nearer to the base are tried.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import lgp
from lgp.kinematics.robot import urdf_of
from lgp.kinematics.urdf import read_urdf
from lgp.scene.model import GRIP_DEPTH
from lgp.scene.scene_file import read_scene

DOCS = Path(__file__).parent
TABLE, PAGE = DOCS / "arms.toml", DOCS / "arms.md"
HEIGHT, SIDE, POSTURES = 0.9, 0.04, 200
"""[m] Height of the table; side of the cube; random postures."""
SEARCH: dict[str, Any] = {"depth": 1, "seconds": 60.0}
"""Limits of a plan: an arm that reaches the table at all has one in a few seconds."""
GRASPS = "grasps"
"""Name of the hand, which no link has."""
PLACES = (0.0, 0.1, 0.25, 0.4, 0.6)
"""Which of the postures give the place of the table, as a share of all from far to near."""
HEAD = """# Arms that were tried

Every arm of the package example-robot-data takes a cube from a table, from its URDF alone ([scenes](scenes.md)), with
the hand of `docs/arms.toml`. *Joints* are those between the base and the hand, *slides* and *endless* ones among them;
joints that follow another one are left out. What the [audit](planner.md) finds are contacts between bodies as the URDF
draws them: many robots of the package stand with bodies in each other at first, or have a hand without jaws. An arm
that is folded into itself in the middle of its joint limits starts from the first of 20 random postures in which it is
not. A plan has a minute.

`python docs/arms.py` tries all of them again and writes this page, `python docs/arms.py UR5` those with UR5 in their
name; *tried* is the day on which a row was written.

| arm | URDF | hand | joints | slides | endless | plan | audit | tried |
|---|---|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Outcome:
    """What came of an arm: its row of the table; `planned` where there is a plan."""

    name: str
    urdf: str
    hand: str
    joints: int
    slides: int
    endless: int
    planned: bool
    plan: str
    audit: str

    @property
    def row(self) -> str:
        cells = (self.name, f"`{self.urdf.split('/')[-1]}`", f"`{self.hand}`", self.joints, self.slides, self.endless)
        day = datetime.now(UTC).date()
        return f"| {' | '.join(map(str, (*cells, self.plan, self.audit, day)))} |"


def arms() -> dict[str, tuple[str, dict[str, Any]]]:
    """Return name -> URDF and hand, as scenes state it."""
    table: dict[str, Any] = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    keys = ("frame", "reach", "rotation")
    return {name: (urdf, dict(zip(keys, hand, strict=False))) for name, (urdf, *hand) in table["arms"].items()}


def chain(urdf: str, hand: str) -> tuple[dict[str, str], list[str]]:
    """Return the moving joints between the base and the hand with their types, and all other ones that move."""
    root, _ = read_urdf(urdf_of(urdf))
    above: dict[str, tuple[str, str, str]] = {}
    kinds: dict[str, str] = {}
    follows = set()
    for joint in root.findall("joint"):
        ends = [str(end.get("link")) for tag in ("parent", "child") for end in joint.findall(tag)]
        name, kind = str(joint.get("name")), str(joint.get("type"))
        above[ends[1]] = (ends[0], name, kind)
        if kind != "fixed":
            kinds[name] = kind
        if joint.find("mimic") is not None:
            follows.add(name)
    own: dict[str, str] = {}
    link = hand
    while link in above:
        link, name, kind = above[link]
        if name in kinds:
            own[name] = kind
    return own, [name for name in kinds if name not in own and name not in follows]


def tried(name: str, urdf: str, hand: dict[str, Any]) -> Outcome:
    """Plan for one arm."""
    own, others = chain(urdf, hand["frame"])
    robot = {"model": urdf, "position": [0, 0, 0], "locked": others, "hands": {GRASPS: {"tilt": 180} | hand}}
    values: dict[str, Any] = {
        "domain": "screwdriver",
        "initial": ["on_table(cube)", f"free(arm.{GRASPS})"],
        "goal": [f"grasped(arm.{GRASPS}, cube)"],
        "phase_seconds": 6.0,
        "robots": {"arm": robot},
        "tables": {"spot": {"position": [0, 0], "size": [0.06, 0.06], "height": HEIGHT, "thickness": 0.01}},
        "objects": {"cube": {"size": [SIDE] * 3, "mass": 0.1, "on": "table.spot"}},
    }
    world = lgp.World(read_scene(values, name))
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (POSTURES, world.nq))
    at = world.at(q, [f"arm.{GRASPS}"]).position[:, 0]
    farthest_first = np.argsort(-np.linalg.norm(at[:, :2], axis=1))
    kinds = list(own.values())
    result = Outcome(
        name, urdf, hand["frame"], world.nq, kinds.count("prismatic"), kinds.count("continuous"), False, "", ""
    )
    without = ""
    for place, accept in (*((place, False) for place in PLACES), (PLACES[0], True)):
        target = at[farthest_first[int(place * (POSTURES - 1))]]
        robot["position"] = [0, 0, float(HEIGHT + SIDE - GRIP_DEPTH - target[2])]
        values["tables"]["spot"]["position"] = target[:2].tolist()
        scene = read_scene(values, name)
        plan, start = planned(scene, q, accept)
        reason = plan.reason if plan else start
        if plan and not reason:
            break
        if not without and lgp.plan(scene, cost=None, **SEARCH, collisions=False, accept_start=True).feasible:
            without = f"without bodies only: {reason}"
    else:
        return replace(result, plan=without or f"none: {reason}", audit="-")
    audit = lgp.audit_plan(plan)
    found = "clean" if audit.clean else f"{len(audit.faults)} faults: {audit.faults[0].what}, ..."
    if len(audit.faults) == 1:
        found = audit.faults[0].what
    return replace(result, planned=True, plan=start, audit=found)


def planned(scene: lgp.Scene, starts: np.ndarray, accept: bool) -> tuple[lgp.Plan | None, str]:
    """Return a plan and from where: the middle of the joint limits, else the first of some configurations (n, nq) in
    which no bodies are in each other; where they are in all of them, None, or a plan if that is accepted."""
    try:
        return lgp.plan(scene, cost=None, **SEARCH), "yes"
    except lgp.LgpError as error:
        for start in starts[:20]:
            try:
                return lgp.plan(scene, cost=None, **SEARCH, start=start), "yes, from another posture"
            except lgp.LgpError:
                continue
        if not accept:
            return None, str(error)
    return lgp.plan(scene, cost=None, **SEARCH, accept_start=True), "yes, from a start with bodies in each other"


def rows() -> dict[str, str]:
    """Return name -> row of every arm on the page."""
    lines = PAGE.read_text(encoding="utf-8").splitlines() if PAGE.exists() else []
    return {line.split(" | ")[0].removeprefix("| "): line for line in lines if line.startswith("| ")}


def main(words: list[str]) -> None:
    names = arms()
    for name in [name for name in names if not words or any(word in name for word in words)]:
        row = tried(name, *names[name]).row
        sys.stdout.write(row + "\n")
        sys.stdout.flush()
        known = rows() | {name: row}
        PAGE.write_text(HEAD + "".join(known[arm] + "\n" for arm in names if arm in known), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
