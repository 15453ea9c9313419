"""Try every arm of example-robot-data in a scene of its own, and write what came of it to docs/arms.md.

python docs/arms.py             all arms, one after another
python docs/arms.py UR5 Kinova  those whose name contains one of the words; prints their rows and writes nothing

Each arm takes a cube of 4 cm from a small table, as a scene says it: its URDF, the link that grasps, and the joints
that are no part of the arm locked. The table is where the arm reaches far with one of 200 random postures; what is
below and around the robot is left away. Where it finds no plan, four places nearer to the base are tried.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import lgp
from lgp.kinematics.robot import urdf_of
from lgp.kinematics.urdf import read_urdf
from lgp.scene.scene_file import read_scene

DOCS = Path(__file__).parent
TABLE, PAGE = DOCS / "arms.toml", DOCS / "arms.md"
HEIGHT, SIDE, POSTURES = 0.9, 0.04, 200
"""[m] Height of the table; side of the cube; random postures."""
PLACES = (0.0, 0.1, 0.25, 0.4, 0.6)
"""Which of the postures give the place of the table, as a share of all from far to near."""
HEAD = """# Arms that were tried

Written by `python docs/arms.py`: every arm of the package example-robot-data takes a cube from a table, from its URDF
alone ([scenes](scenes.md)). *Joints* are those between the base and the hand, *slides* and *endless* ones among them;
joints that follow another one are left out. What the [audit](planner.md) finds are contacts between bodies as the URDF
draws them: many robots of the package stand with bodies in each other at first, or have a hand without jaws. An arm
that is folded into itself in the middle of its joint limits starts from the first of 20 random postures in which it is
not.

| arm | URDF | hand | joints | slides | endless | plan | audit |
|---|---|---|---|---|---|---|---|
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
        return f"| {' | '.join(map(str, (*cells, self.plan, self.audit)))} |"


def arms() -> dict[str, tuple[str, str, float]]:
    """Return name -> URDF, link that grasps, and distance of the grasping point from it [m]."""
    table: dict[str, Any] = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return {name: (urdf, hand, *(reach or [0.0])) for name, (urdf, hand, *reach) in table["arms"].items()}


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


def tried(name: str, urdf: str, hand: str, reach: float) -> Outcome:
    """Plan for one arm."""
    own, others = chain(urdf, hand)
    grasps = {"frame": hand, "reach": reach, "tilt": 180}
    robot = {"model": urdf, "position": [0, 0, 0], "locked": others, "hands": {"hand": grasps}}
    values: dict[str, Any] = {
        "domain": "screwdriver",
        "initial": ["on_table(cube)", "free(arm.hand)"],
        "goal": ["grasped(arm.hand, cube)"],
        "phase_seconds": 6.0,
        "robots": {"arm": robot},
        "tables": {"spot": {"position": [0, 0], "size": [0.06, 0.06], "height": HEIGHT, "thickness": 0.01}},
        "objects": {"cube": {"size": [SIDE] * 3, "mass": 0.1, "on": "table.spot"}},
    }
    world = lgp.World(read_scene(values, name))
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (POSTURES, world.nq))
    at = world.at(q, ["arm.hand"]).position[:, 0]
    farthest_first = np.argsort(-np.linalg.norm(at[:, :2], axis=1))
    kinds = list(own.values())
    result = Outcome(name, urdf, hand, world.nq, kinds.count("prismatic"), kinds.count("continuous"), False, "", "")
    without = ""
    for place in PLACES:
        target = at[farthest_first[int(place * (POSTURES - 1))]]
        robot["position"] = [0, 0, float(HEIGHT + SIDE / 2 - target[2])]
        values["tables"]["spot"]["position"] = target[:2].tolist()
        scene = read_scene(values, name)
        plan, start = planned(scene, q)
        reason = plan.reason
        if not reason:
            break
        if not without and lgp.plan(scene, cost=None, depth=1, collisions=False, accept_start=True).feasible:
            without = f"without bodies only: {reason}"
    else:
        return replace(result, plan=without or f"none: {reason}", audit="-")
    audit = lgp.audit_plan(plan)
    found = "clean" if audit.clean else f"{len(audit.faults)} faults: {audit.faults[0].what}, ..."
    if len(audit.faults) == 1:
        found = audit.faults[0].what
    return replace(result, planned=True, plan=start, audit=found)


def planned(scene: lgp.Scene, starts: np.ndarray) -> tuple[lgp.Plan, str]:
    """Return a plan and from where: the middle of the joint limits, else the first of some configurations (n, nq) in
    which no bodies are in each other."""
    try:
        return lgp.plan(scene, cost=None, depth=1), "yes"
    except lgp.LgpError:
        for start in starts[:20]:
            try:
                return lgp.plan(scene, cost=None, depth=1, start=start), "yes, from another posture"
            except lgp.LgpError:
                continue
    return lgp.plan(scene, cost=None, depth=1, accept_start=True), "yes, from a start with bodies in each other"


def main(words: list[str]) -> None:
    chosen = {name: arm for name, arm in arms().items() if not words or any(word in name for word in words)}
    rows = []
    for name, arm in chosen.items():
        rows.append(tried(name, *arm).row)
        sys.stdout.write(rows[-1] + "\n")
        sys.stdout.flush()
    if not words:
        PAGE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
