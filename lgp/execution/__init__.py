"""Execution: follow a plan step by step while the world deviates.

source (simulated or replayed tracker) -> `View` -> predicates of the current action -> `Executive`
    -> commands to the robots (`Segment`s), events to the page, everything to the log

The human is watched, never commanded. An object found elsewhere than planned moves one robot motion there (`Planner`);
if that is infeasible the rest is planned anew.
"""

from __future__ import annotations
