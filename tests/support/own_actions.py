"""Actions of one's own that a test registers, and takes back afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import lgp
from lgp.kinematics import actions

INSPECTION = """
(define (domain inspection)
  (:requirements :strips :typing)
  (:types hand thing table - object human_hand robot_hand - hand)
  (:predicates (free ?e - hand) (on_table ?o - thing) (inspected ?o - thing))
  (:action inspect
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (inspected ?o)))
"""


@contextmanager
def registered(name: str, kind: lgp.ActionKind) -> Iterator[None]:
    """Register an action; what was registered before is afterwards."""
    before = dict(actions._registered)
    lgp.register_action(name, kind)
    try:
        yield
    finally:
        actions._registered.clear()
        actions._registered.update(before)


def inspection(folder: Path) -> str:
    """Return the path of the domain with the one action `inspect`."""
    file = folder / "inspection.pddl"
    file.write_text(INSPECTION)
    return str(file)
