"""Execution: follow a plan action by action while the world deviates from it.

observations (simulated or recorded) -> `TrackedWorld` -> predicates of the current action -> `Executive`
    -> robot motions (`JointTrajectory`), events for page and log

The human is observed, never commanded. If an object is not where the plan has it, the motion of the current action is
retargeted to its tracked pose (`Planner.retarget`); if that is infeasible, the remaining actions are replanned
(`Planner.replan`).
"""

from __future__ import annotations
