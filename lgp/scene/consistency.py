"""Whether the first facts of a scene and its geometry tell the same: what lies where, and what is in which hand.

A fact is what the logic starts from, `on`, `at` and `hand` are what the geometry starts from. Where they differ, a goal
counts as reached that is not, or a hand as free that is full. Predicates have the meaning that the shipped domains give
them: `placed`, `on_table`, `grasped`, `free`.
"""

from __future__ import annotations

from lgp.errors import SceneError
from lgp.logic.task import Atom, parse_atom, parse_goal
from lgp.scene.footing import LEAST_SHARE, first_share, footprint
from lgp.scene.model import Scene


def check_first_facts(scene: Scene) -> None:
    """Refuse a scene whose first facts contradict its geometry.

    `placed` may also name tables where an object was before, as in the domains of the paper grasping does not delete
    it; one of them must be the table that it lies on.

    Raises:
        SceneError: names the fact and the key that disagree.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> check_first_facts(load_scene("screwdriver"))
    """
    facts = [parse_atom(text) for text in scene.initial]
    unwanted = parse_goal(scene.goal)[1]
    placed: dict[str, list[str]] = {}
    for fact in facts:
        if fact.predicate == "placed" and len(fact.arguments) == 2:
            placed.setdefault(fact.arguments[0], []).append(fact.arguments[1])
    grasped = {fact.arguments for fact in facts if fact.predicate == "grasped"}
    for name, item in scene.objects.items():
        where = f"{scene.name}: objects.{name}"
        if item.hand:
            payload = scene.hands[item.hand].payload
            if item.mass > payload:
                raise SceneError(
                    f"{where} of {item.mass:g} kg is in {item.hand}, whose payload is {payload:g} kg; correct one"
                )
            if (item.hand, name) not in grasped:
                raise SceneError(
                    f"{where} is in {item.hand}, but `initial` has no grasped({item.hand}, {name}); add the fact"
                )
            for fact in facts:
                if fact.arguments in {(name,), (item.hand,)} and fact.predicate in ("on_table", "free"):
                    raise SceneError(f"{where} is in {item.hand}, but `initial` says {fact}; remove the fact")
            continue
        clearance, height = scene.tables[item.on].clearance, item.size["xyz".index(item.up)]
        if height >= clearance:
            raise SceneError(
                f"{where} is {height:g} m high on {item.on}, above which are {clearance:.3g} m; correct one of them"
            )
        share = first_share(scene.tables[item.on], item)
        if share < LEAST_SHARE:
            foot = " x ".join(f"{2.0 * half:g}" for half in footprint(item, item.up))
            raise SceneError(
                f"{where} of {foot} m has {100 * share:.0f} % of its footprint on {item.on}, "
                f"expected {100 * LEAST_SHARE:.0f} % or more; move it, or correct its size"
            )
        for fact in (Atom("placed", (name, item.on)), Atom("on_table", (name,))):
            if fact in unwanted and fact not in facts:
                raise SceneError(
                    f"{where} is on {item.on}, the goal is not {fact}, but `initial` has no {fact}; add the fact"
                )
        if name in placed and item.on not in placed[name]:
            raise SceneError(
                f"{where} is on {item.on}, but `initial` says placed({name}, {placed[name][0]}); correct one of them"
            )
    for hand, name in grasped:
        if name in scene.objects and scene.objects[name].hand != hand:
            on = scene.objects[name].hand or scene.objects[name].on
            raise SceneError(
                f"{scene.name}: `initial` says grasped({hand}, {name}), but objects.{name} is on {on}; "
                f'give it hand = "{hand}" and in_hand'
            )
