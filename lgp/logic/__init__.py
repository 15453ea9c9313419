"""Symbolic planning: PDDL domains, ground tasks with bit-mask states, delete-relaxation heuristics.

PDDL text -> `PddlDomain` -> `ground(domain, objects, initial, goal)` -> `Task`
"""

from __future__ import annotations

from lgp.logic.heuristic import RelaxedPlan, relaxed_plan, why_unreachable
from lgp.logic.pddl import ActionSchema, PddlDomain, load_domain, parse_domain
from lgp.logic.task import Action, Atom, Task, ground, parse_atom, parse_goal

__all__ = [
    "Action",
    "ActionSchema",
    "Atom",
    "PddlDomain",
    "RelaxedPlan",
    "Task",
    "ground",
    "load_domain",
    "parse_atom",
    "parse_domain",
    "parse_goal",
    "relaxed_plan",
    "why_unreachable",
]
