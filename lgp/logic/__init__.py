"""The symbolic half of the program: PDDL domains, ground tasks, relaxed heuristics.

PDDL text -> Domain -> ground(domain, objects, initial, goal) -> Task: states are integers, one bit an atom
"""

from __future__ import annotations

from lgp.logic.heuristic import RelaxedPlan, relaxed_plan, why_unreachable
from lgp.logic.pddl import ActionSchema, PddlDomain, load_domain, parse_domain
from lgp.logic.task import Action, Atom, Task, ground, parse_atom

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
    "relaxed_plan",
    "why_unreachable",
]
