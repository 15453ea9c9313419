"""Scene files: TOML to a frozen `Scene`, strict in keys, types and ranges."""

from __future__ import annotations

import copy
import math
import os
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lgp.errors import SceneError
from lgp.logic.pddl import shipped_domains
from lgp.scene.mobile_base import read_base
from lgp.scene.model import (
    HAND_CLEARANCE,
    Assembly,
    FreeParameter,
    Grip,
    Hand,
    Robot,
    Scene,
    SceneCost,
    SceneObject,
    Table,
)
from lgp.scene.people import FREEDOMS, RESERVED, SHORT, payload_of, read_people
from lgp.scene.surroundings import FARTHEST, read_obstacle, read_shelf
from reba.checks import PATH, accepts, instance
from reba.errors import did_you_mean
from reba.open_file import read_settings
from reba.toml_table import TomlTable

SHIPPED = Path(__file__).parents[1] / "scenes"
ROBOTS = Path(__file__).parent / "data" / "robots.toml"
PHASE_SECONDS = 2.0
"""[s] Phase by default (a choice)."""
USUAL_SLICE = 0.2
LONGEST_SLICE = 0.25
"""[s] Longest slice: in longer ones bodies move through each other in between (half a second leaves 10 to 17 mm)."""
FINGER = 0.08
"""[m] How far a grip may be below the surface: a finger's length."""
SHORTEST_PHASE = 0.2
"""[s] Shortest phase (a choice): no action of a person is done in less."""
COST_PER = ("second", "slice")


@cache
def known_robots() -> dict[str, Any]:
    """Return the table of robots that scenes refer to by name (read once)."""
    return tomllib.loads(ROBOTS.read_text(encoding="utf-8"))


def shipped_scenes() -> tuple[str, ...]:
    """Return the names of the scenes in the package."""
    return tuple(sorted(file.stem for file in SHIPPED.glob("*.toml")))


@accepts(SceneError, which=PATH, changes=instance("values by dotted key", Mapping).or_none())
def load_scene(which: str | Path, changes: Mapping[str, Any] | None = None) -> Scene:
    """Return a shipped scene by its name, or the scene in a TOML file.

    Args:
        which: name or path.
        changes: dotted key of a scene file -> its value, such as `{"human.stature": 1.6}`.

    Raises:
        SceneError: unknown name, unreadable file, unknown key, wrong value or unknown table, hand or joint.

    >>> load_scene("screwdriver").goal
    ('grasped(human.right_hand, screwdriver)',)
    """
    path = SHIPPED / f"{which}.toml"
    if not os.path.isfile(path):  # also false for names that no file can have
        path = Path(which)
    if not os.path.isfile(path):  # also false for names that no file can have
        names = shipped_scenes()
        hint = did_you_mean(str(which), names)
        raise SceneError(f"scene is {str(which)!r}, expected {', '.join(names)} or the path of a TOML file{hint}")
    try:
        values = tomllib.loads(read_settings(path))
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: cannot be read ({error}); give a TOML text file") from error
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits, and deep nesting
        raise SceneError(f"{path}: not TOML: {error}; correct that line") from error
    return read_scene(_with_absolute_paths(values, path.parent), path.stem, changes)


def _slices(entries: TomlTable) -> int:
    """Return the slices of a phase; by default as many as slices of 0.2 s need."""
    seconds = entries.number("phase_seconds", PHASE_SECONDS)
    slices = entries.whole("slices", max(2, math.ceil(seconds / USUAL_SLICE)), low=2, high=3000)
    if seconds / slices > LONGEST_SLICE * (1.0 + 1e-9):
        raise SceneError(
            f"{entries.where}: {slices} slices of {seconds / slices:.3g} s each, expected {LONGEST_SLICE:g} s or less; "
            f"give {math.ceil(seconds / LONGEST_SLICE)} slices or more"
        )
    return slices


def _with_absolute_paths(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the values of a file whose relative paths start from its folder, so that they hold everywhere."""

    def absolute(path: Any) -> Any:
        if isinstance(path, str):
            for place in (folder, Path()):
                if os.path.isfile(place / path):
                    return str((place / path).absolute())
        return path

    if values.get("domain") not in shipped_domains():
        values["domain"] = absolute(values.get("domain"))
    cost = values.get("cost")
    if isinstance(cost, dict) and str(cost.get("model")).endswith(".json"):
        cost["model"] = absolute(cost["model"])
    robots = values.get("robots")
    for robot in robots.values() if isinstance(robots, dict) else ():
        if isinstance(robot, dict) and str(robot.get("model")).endswith(".urdf"):
            robot["model"] = absolute(robot["model"])
        if isinstance(robot, dict) and isinstance(robot.get("packages"), list):
            robot["packages"] = [
                str((folder / part).absolute()) if isinstance(part, str) else part for part in robot["packages"]
            ]
    obstacles = values.get("obstacles")
    for obstacle in obstacles.values() if isinstance(obstacles, dict) else ():
        if isinstance(obstacle, dict) and "mesh" in obstacle:
            obstacle["mesh"] = absolute(obstacle["mesh"])
    return values


def read_scene(values: Mapping[str, Any], name: str = "scene", changes: Mapping[str, Any] | None = None) -> Scene:
    """Return the scene of a table of values, as read from TOML; raises as `load_scene`."""
    chosen = _changed(values, changes or {}, name)
    entries = TomlTable(name, chosen, SceneError)
    tables = {f"table.{key}": _table(key, entry) for key, entry in entries.tables("tables").items()}
    obstacles = {f"obstacle.{key}": read_obstacle(key, entry) for key, entry in entries.tables("obstacles").items()}
    for key, entry in entries.tables("shelves").items():
        boards, walls = read_shelf(key, entry)
        tables |= boards
        obstacles |= walls
    objects = {key: _object(key, entry, tables) for key, entry in entries.tables("objects").items()}
    scene = Scene(
        name=name,
        title=entries.text("title", ""),
        domain=entries.text("domain"),
        initial=entries.texts("initial"),
        goal=entries.texts("goal"),
        phase_seconds=entries.number("phase_seconds", PHASE_SECONDS, low=SHORTEST_PHASE, high=600.0),
        slices=_slices(entries),
        humans=read_people(entries),
        robots={key: _robot(key, entry) for key, entry in entries.tables("robots").items()},
        tables=tables,
        objects=objects,
        obstacles=obstacles,
        assemblies=tuple(
            _assembly(number, entry, name, objects) for number, entry in enumerate(_list(entries, "joints"))
        ),
        cost=_cost(entries.table("cost")) if entries.has("cost") else SceneCost(),
        depth=entries.whole("depth", 4, low=1, high=40),
        hand_clearance=entries.number("hand_clearance", HAND_CLEARANCE, low=0.0, high=1.0),
        durations=entries.text("durations", "fixed", ("fixed", "stretched", "free")),
        concurrent=entries.has("concurrent") and entries.flag("concurrent"),
        choices=tuple(_choice(number, entry, name) for number, entry in enumerate(_list(entries, "choices"))),
        values=chosen,
    )
    entries.done()
    _check_names(scene)
    return scene


def _changed(values: Mapping[str, Any], changes: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a copy with other values for dotted keys; a key that no scene has is refused as one of the file is."""
    try:
        result = copy.deepcopy(dict(values))
    except RecursionError as error:
        raise SceneError(f"{name}: its values are nested too deeply; write the scene flat") from error
    for dotted, value in changes.items():
        *parents, last = str(dotted).split(".")
        inner: Any = result
        for key in parents:
            inner = inner.setdefault(key, {}) if isinstance(inner, dict) else None
        if not isinstance(inner, dict):
            raise SceneError(f"{name}: no key {dotted!r} to change; give a key of the scene file")
        inner[last] = value
    return result


def _list(entries: TomlTable, key: str) -> list[Any]:
    value = entries.values[key] if entries.has(key) else []
    if not isinstance(value, list):
        raise SceneError(f"{entries.where}: {key} is {value!r}, expected a list of tables ([[{key}]])")
    return value


def _choice(number: int, value: Any, name: str) -> FreeParameter:
    entries = TomlTable(f"{name}: choices[{number}]", value, SceneError)
    choice = FreeParameter(entries.texts("keys"), entries.text("reason"))
    entries.done()
    return choice


def _cost(entries: TomlTable) -> SceneCost:
    terms = entries.table("terms")
    cost = SceneCost(
        entries.text("model", SceneCost.model),
        entries.number("weight", SceneCost.weight, 0.0, 1e6),
        entries.text("per", SceneCost.per, COST_PER),
        entries.number("time_weight", SceneCost.time_weight, low=0.0, high=1000.0),
        {name: terms.number(name, low=0.0, high=1e6) for name in terms.values},
    )
    entries.done()
    return cost


def _robot(name: str, entries: TomlTable) -> Robot:
    if name in (SHORT, *RESERVED):
        raise SceneError(f"{entries.where}: robot name {name!r} is reserved; give it another name")
    model = entries.text("model")
    known = known_robots().get(model, {})
    position = entries.values.get("position")
    if isinstance(position, list) and len(position) == 2 and "height" in known:
        placement = (*entries.vector("position", 2, None, -FARTHEST, FARTHEST), float(known["height"]))
    else:
        placement = entries.vector("position", 3, None, -FARTHEST, FARTHEST)
    hands = entries.tables("hands")
    if not hands:
        defaults = known.get("hands", {})
        hands = {hand: TomlTable(f"{entries.where}.hands.{hand}", {}, SceneError) for hand in defaults}
    base = entries.table("base")
    robot = Robot(
        name=name,
        position=placement,
        yaw=entries.number("yaw", 0.0),
        hands=tuple(_hand(name, hand, entry, known.get("hands", {}).get(hand, {})) for hand, entry in hands.items()),
        locked=entries.texts("locked", tuple(known.get("locked", ()))),
        joints=dict(known.get("joints", {})) | entries.numbers("joints"),
        model=model,
        base=read_base(base) if entries.has("base") else None,
        packages=entries.texts("packages", ()),
    )
    entries.done()
    return robot


def _hand(agent: str, name: str, entries: TomlTable, known: Mapping[str, Any]) -> Hand:
    hand = Hand(
        agent=agent,
        name=name,
        frame=entries.text("frame", known.get("frame")),
        reach=entries.number("reach", known.get("reach", 0.0)),
        kind=entries.text("kind", "robot_hand"),
        tilt=entries.number("tilt", 90.0, 0.0, 180.0),
        freedom=entries.text("freedom", "free", FREEDOMS),
        payload=payload_of(entries, float(known.get("payload", math.inf))),
        rotation=entries.vector("rotation", 3, (0.0, 0.0, 0.0), -360.0, 360.0),
    )
    entries.done()
    return hand


def _table(name: str, entries: TomlTable) -> Table:
    frame = entries.text("frame", "")
    least = -3.0 if frame else 0.01
    if isinstance(entries.values.get("height"), list):
        low, high = entries.vector("height", 2, low=least, high=3.0)
        if high < low:
            raise SceneError(f"{entries.where}: height is [{low:g}, {high:g}], expected [lowest, highest]")
    else:
        low = high = entries.number("height", low=least, high=3.0)
    if frame and entries.has("clearance"):
        raise SceneError(f"{entries.where}: gives frame and clearance, expected one of them; a robot carries no cover")
    table = Table(
        name=name,
        position=entries.vector("position", 2, None, -FARTHEST, FARTHEST),
        yaw=entries.number("yaw", 0.0),
        size=entries.vector("size", 2, low=0.01, high=100.0),
        height=(low + high) / 2.0,
        heights=(low, high),
        thickness=entries.number("thickness", 0.03, low=0.001, high=3.0),
        clearance=entries.number("clearance", low=0.01, high=3.0) if entries.has("clearance") else math.inf,
        covered=entries.has("clearance"),
        frame=frame,
    )
    entries.done()
    return table


def _object(name: str, entries: TomlTable, tables: Mapping[str, Table]) -> SceneObject:
    scene_object = SceneObject(
        name=name,
        size=entries.vector("size", 3, low=0.001, high=100.0),
        mass=entries.number("mass", low=0.0, high=1000.0),
        on=entries.text("on", "" if entries.has("hand") else None, [*tables, *([""] if entries.has("hand") else [])]),
        at=entries.vector("at", 3, (0.0, 0.0, 0.0)),
        slide=entries.number("slide", 0.0, low=0.0, high=100.0),
        hand=entries.text("hand", ""),
        in_hand=entries.vector("in_hand", 6, (0.0,) * 6),
        up=entries.text("up", "z", ("x", "y", "z")),
        grips={kind: _grip(entry) for kind, entry in entries.tables("grips").items()},
    )
    entries.done()
    for kind, grip in scene_object.grips.items():
        deep = min(side / 2.0 - abs(at) for side, at in zip(scene_object.size, grip.at, strict=True))
        if deep > FINGER:
            raise SceneError(
                f"{entries.where}: the grip of {kind} is {deep:.3f} m inside the object, expected {FINGER:g} m or "
                "less; put it near a surface that fingers reach around"
            )
    table = tables.get(scene_object.on)
    if table is not None and any(abs(at) > size / 2 for at, size in zip(scene_object.at[:2], table.size, strict=True)):
        raise SceneError(
            f"{entries.where}: at {scene_object.at[:2]} is off {scene_object.on}, whose top is {table.size}"
        )
    return scene_object


def _grip(entries: TomlTable) -> Grip:
    grip = Grip(
        entries.vector("at", 3, (0.0, 0.0, 0.0)),
        entries.unit("along", (0.0, 0.0, -1.0)),
        entries.number("slide", 0.0, 0.0, 100.0),
    )
    entries.done()
    return grip


def _assembly(number: int, value: Any, name: str, objects: Mapping[str, SceneObject]) -> Assembly:
    entries = TomlTable(f"{name}: joints[{number}]", value, SceneError)
    parts = entries.texts("parts")
    if len(set(parts)) != 2:
        raise SceneError(f"{entries.where}: parts is {list(parts)}, expected the names of two objects")
    for part in parts:
        if part not in objects:
            raise SceneError(f"{entries.where}: no object {part!r}{did_you_mean(part, objects)}")
    assembly = Assembly(
        parts=(parts[0], parts[1]),
        position=entries.vector("position", 3, None, -FARTHEST, FARTHEST),
        yaw=entries.number("yaw", 0.0),
        screw=entries.vector("screw", 3),
        along=entries.unit("along"),
        tool=entries.number("tool", 0.0, low=0.0, high=100.0),
    )
    entries.done()
    return assembly


def _check_distinct(scene: Scene) -> None:
    """Refuse two things of one name among what plans name: persons, robots, hands, objects and tables."""
    kinds = {"person": scene.humans, "robot": scene.robots, "hand": scene.hands, "object": scene.objects,
             "table": scene.tables}  # fmt: skip
    known: dict[str, str] = {}
    for kind, names in kinds.items():
        for name in names:
            if name in known:
                both = f"{known[name]} and {kind}"
                raise SceneError(f"{scene.name}: {name!r} is the name of two, {both}; give one of them another name")
            known[name] = kind


def _check_names(scene: Scene) -> None:
    """Refuse a scene without agents, and hands or atoms with unknown names."""
    _check_distinct(scene)
    known = scene.object_types
    if not scene.agents:
        raise SceneError(f"{scene.name}: no agent, expected [human], [humans.NAME] or [robots.NAME]; add one of them")
    for table in scene.tables.values():
        robot, _, link = table.frame.partition(".")
        if table.frame and not (link and robot in scene.robots):
            hint = did_you_mean(robot, scene.robots) or "; expected ROBOT.LINK, a link or joint of one of its robots"
            raise SceneError(f"{scene.name}: tables.{table.name} is on {table.frame!r}, which is of no robot{hint}")
    for scene_object in scene.objects.values():
        if scene_object.hand and scene_object.hand not in scene.hands:
            hint = did_you_mean(scene_object.hand, scene.hands) or f"; known are {', '.join(scene.hands)}"
            raise SceneError(
                f"{scene.name}: objects.{scene_object.name} is in unknown hand {scene_object.hand!r}{hint}"
            )
        kinds = {"human_hand", "robot_hand", *(hand.kind for hand in scene.hands.values())}
        for kind in scene_object.grips:
            near = "" if kind in kinds else did_you_mean(kind, sorted(kinds))
            if near:
                raise SceneError(
                    f"{scene.name}: objects.{scene_object.name} has grips of no kind of hand {kind!r}{near}"
                )
    for text in (*scene.initial, *scene.goal):
        _, _, inside = text.partition("(")  # of a goal that begins with "not " too
        for word in (part.strip() for part in inside.rstrip(") ").split(",")):
            if f"obstacle.{word.removeprefix('obstacle.')}" in scene.obstacles:
                raise SceneError(
                    f"{scene.name}: {text!r} names the obstacle {word!r}, expected hands, objects and tables; "
                    "make it one of [tables] if things stand on it"
                )
            if word and word not in known:
                hint = did_you_mean(word, known) or f"; known are {', '.join(known)}"
                agent, _, hand = word.partition(".")
                if hand and agent in scene.robots and not any(one.agent == agent for one in scene.hands.values()):
                    hint = f"; {agent} has no hands: add hands.{hand} = {{ frame = ... }} to [robots.{agent}]"
                raise SceneError(f"{scene.name}: {text!r} contains unknown {word!r}{hint}")
