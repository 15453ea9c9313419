"""Instructions to the worker: a sentence for each action of a plan."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from lgp.kinematics.actions import sentences_of
from lgp.kinematics.modes import KinematicSwitch
from lgp.path.phases import Phases
from lgp.scene.model import Scene

TABLE = Path(__file__).parent / "data" / "sentences.toml"


@dataclass(frozen=True)
class Instruction:
    """An action in words: a sentence, a few words, whether the reader acts (`you`) or a robot, who that is, and the
    object.

    `beside` are the actions of others at the same time; the sentence has them too.
    """

    text: str
    short: str
    you: bool
    who: str
    object_name: str
    beside: tuple[Instruction, ...] = ()


def sentences(scene: Scene, switches: Sequence[KinematicSwitch]) -> tuple[Instruction, ...]:
    """Return the instructions of a sequence of actions.

    >>> from lgp.scene.scene_file import load_scene
    >>> from lgp.kinematics.modes import KinematicSwitch
    >>> scene = load_scene("screwdriver")
    >>> print(sentences(scene, [KinematicSwitch("grasp", "baxter.left", "screwdriver")])[0].text)
    The robot, using its left arm, picks up the screwdriver from the start table.
    """
    table_of: dict[str, str] = {name: scene_object.on for name, scene_object in scene.objects.items()}
    lines = []
    for switch in switches:
        lines.append(_line(scene, switch, table_of.get(switch.object_name, "")))
        if switch.action.attaches_to:
            table_of[switch.object_name] = switch.table
    return tuple(lines)


def instructions(phases: Phases) -> tuple[Instruction, ...]:
    """Return the instruction of each phase; of actions at the same time that of the reader comes first."""
    lines, joined = sentences(phases.scene, phases.switches), []
    for number in range(phases.count):
        own = [line for line, phase in zip(lines, phases.phase_of, strict=True) if phase == number]
        first, *others = sorted(own, key=lambda line: not line.you)
        also = [table()["words"]["also"].format(sentence=_within(one)) for one in others]
        joined.append(replace(first, text=" ".join([first.text, *also]), beside=tuple(others)))
    return tuple(joined)


def _within(line: Instruction) -> str:
    """Return the sentence of an instruction as it stands inside another one: names keep their first letter."""
    return line.text if line.text.startswith(f"{line.who},") else line.text[0].lower() + line.text[1:]


def humanised(name: str) -> str:
    """Return a name of a plan in words.

    >>> humanised("toolbox/side.left"), humanised("table.stock"), humanised("table.bench"), humanised("right_hand")
    ('left toolbox side', 'stock table', 'bench', 'right hand')
    """
    if name in table()["names"]:
        return str(table()["names"][name])
    words = [word for word in re.split(r"[/._\s-]+", name) if word]
    words = [part for word in words for part in re.sub(r"(?<=[a-z])(?=[A-Z0-9])", " ", word).split()]
    if words[:1] == ["table"] and len(words) > 1:
        itself = set(table()["words"]["furniture"]).intersection(words)
        words = [*words[1:], *([] if itself else ["table"])]
    first = [word for word in words if word in table()["words"]["first"]]
    return " ".join([*first, *(word for word in words if word not in first)])


def in_words(scene: Scene, text: str) -> str:
    """Return a text about a scene with its objects, tables and hands in words, as the reader knows them.

    >>> from lgp.scene.scene_file import load_scene
    >>> in_words(load_scene("screwdriver"), "screwdriver lies on table.start, not in human.right_hand")
    'The screwdriver lies on the start table, not in your right hand'
    """
    names = {name: f"the {humanised(name)}" for name in (*scene.objects, *scene.tables)}
    names |= {
        hand: _whose(scene, hand)
        if scene.hands[hand].human
        else table()["words"]["taker"].format(robot=_robot(scene, hand), arm=_limb(scene, hand))
        for hand in scene.hands
    }
    if names:
        longest_first = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
        text = re.sub(rf"(?<![\w./])(?:{longest_first})(?![\w/]|\.\w)", lambda match: names[match[0]], text)
    return text[:1].upper() + text[1:]


@cache
def table() -> dict[str, Any]:
    """Return the table sentences.toml (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def _line(scene: Scene, switch: KinematicSwitch, source_table: str) -> Instruction:
    words, actor, text = table()["words"], switch.giver or switch.hand, sentences_of(switch.kind)
    you, takes = scene.hands[actor].human, scene.hands[switch.hand].human
    person = scene.hands[actor].agent
    names = {role: _named(scene, name) for role, name in switch.arguments.items()}
    arm = words["taker"].format(robot=_robot(scene, switch.hand), arm=_limb(scene, switch.hand))
    names |= {
        "from": words["from"].format(table=f"the {humanised(source_table)}") if source_table else "",
        "giver": humanised(scene.hands[actor].name),
        "robot": _robot(scene, actor),
        "arm": _arm(scene, actor),
        "taker": _whose(scene, switch.hand, person) if takes else arm,
    }
    to_own = bool(switch.giver) and scene.hands[switch.hand].agent == person
    sentence = (text.own_hands if to_own else "") or text.human if you else text.robot
    long, short = (one.format(**names) for one in (sentence, text.human_short if you else text.robot_short))
    who = words["you"] if you else words["other"]
    if you and len(scene.humans) > 1:
        who = person_in_words(person)
        long = f"{who}, {long[0].lower()}{long[1:]}"
    return Instruction(long[0].upper() + long[1:], short, you, who, switch.object_name)


def _named(scene: Scene, name: str) -> str:
    """Return an argument in words: a hand as it is, an object or table with its article."""
    return humanised(scene.hands[name].name) if name in scene.hands else f"the {humanised(name)}"


def person_in_words(name: str) -> str:
    """Return the name of a person as it is written.

    >>> person_in_words("anna")
    'Anna'
    """
    return humanised(name)[:1].upper() + humanised(name)[1:]


def _whose(scene: Scene, hand: str, reader: str = "") -> str:
    """Return the hand of a person in words: that of the only one, or of the `reader`, is yours."""
    own = scene.hands[hand]
    if len(scene.humans) == 1 or own.agent == reader:
        return f"your {humanised(own.name)}"
    return str(table()["words"]["taker"].format(robot=person_in_words(own.agent), arm=humanised(own.name)))


def _agent(scene: Scene, hand: str) -> Any:
    return next(agent for agent in scene.agents if agent.name == scene.hands[hand].agent)


def _robot(scene: Scene, hand: str) -> str:
    words = table()["words"]
    return str(
        words["robot"] if len(scene.robots) <= 1 else words["robots"].format(name=humanised(_agent(scene, hand).name))
    )


def _arm(scene: Scene, hand: str) -> str:
    """Return the arm that a robot uses, in words; "" if it has only one."""
    if len(_agent(scene, hand).hands) <= 1:
        return ""
    return str(table()["words"]["arm"].format(arm=_limb(scene, hand)))


def _limb(scene: Scene, hand: str) -> str:
    name = scene.hands[hand].name
    return str(table()["words"]["arms"].get(name, humanised(name)))
