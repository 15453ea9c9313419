"""The executive: which action is current, whether it may begin, whether it is done, and what to do if it is not.

waiting -> (start predicates hold) -> moving -> (motion over, end predicates hold) -> next action
An object elsewhere than planned: that motion is moved there. A world that contradicts the plan: the rest is planned
anew. Nothing happens in time: tried once more, then failed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgp.execution.predicates import (
    PredicateState,
    all_hold,
    check,
    end_of,
    first_failing,
    grasped,
    gripper_commands,
    start_of,
)
from lgp.execution.replan import shortened
from lgp.execution.retarget import Phase, Planner
from lgp.execution.simulation import Robots
from lgp.execution.tracked_scene import ObjectUnavailable, carrier
from lgp.execution.tracking import TrackedPose, TrackedWorld
from lgp.execution.trajectory import BRAKE, Brake, robot_columns, time_scaled, violations
from lgp.motion import Motion
from lgp.page.sentences import sentences

Report = Callable[[str, str, str, dict[str, Any]], None]
"""Takes state, kind, text and details of what happened."""
SURE = 3
"""Looks in a row that must say that an object was dropped."""


@dataclass(frozen=True)
class Settings:
    """How patient the executive is.

    Attributes:
        patience: time that an action may take longer than its motion, and that is waited for its start [s].
        reminder: time after which somebody who is late is waited for, as the page then says [s].
        grace: time after which a start predicate that does not hold contradicts the plan [s].
        attempts: how often an action is tried.
        search: wall-clock time for a new plan [s].
        slow_down: whether motions faster than the robot's limits are slowed down; otherwise the run fails.
    """

    patience: float = 15.0
    reminder: float = 2.0
    grace: float = 1.0
    attempts: int = 2
    search: float = 20.0
    slow_down: bool = True


@dataclass(frozen=True)
class RetargetedAction:
    """A motion that was moved: of which action of which plan, and how it is now."""

    motion: Motion
    number: int
    phase: Phase


class Executive:
    """Follows a plan.

    Args:
        planner: the plan, and new motions.
        view: the tracked world; the caller adds observations.
        robots: what is commanded.
        report: is told what happens.
        settings: how patient it is.
        number: of the action to begin with.

    Attributes:
        number: of the current action.
        stage: waiting, moving, finished or failed.
        phase: motion of the current action, None while waiting.
        replans: how often the rest was planned anew.
        shifts: motions that were moved because the world had changed, not because the one before was moved.
        verdicts: on the predicates that were checked last.

    Example:
        >>> executive = Executive(planner, view, robots, report)            # doctest: +SKIP
        >>> while not executive.over:                                       # doctest: +SKIP
        ...     view.add(source.observe())
        ...     executive.step()
    """

    def __init__(
        self,
        planner: Planner,
        view: TrackedWorld,
        robots: Robots,
        report: Report,
        settings: Settings | None = None,
        number: int = 0,
    ) -> None:
        self.planner, self.view, self.robots, self.report = planner, view, robots, report
        self.settings = Settings() if settings is None else settings
        self.number, self.stage = number, "waiting"
        self.phase: Phase | None = None
        self.replans = 0
        self.shifts: list[RetargetedAction] = []
        self.verdicts: dict[str, PredicateState] = {}
        self._since: float | None = None
        self._attempts = 0
        self._again = self._moved_before = False
        self._told = ""
        self._doubts = 0
        self._sure_since = 0.0

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        return self.stage in ("finished", "failed")

    def step(self) -> None:
        """Go on by one observation."""
        if self._since is None:
            self._since = self._now
        if self.stage == "waiting" and self.view.settled():
            self._wait()
        elif self.stage == "moving":
            self._move()

    @property
    def _now(self) -> float:
        return self.view.now.time

    @property
    def _waited(self) -> float:
        return self._now - (self._now if self._since is None else self._since)

    def _enter(self, stage: str) -> None:
        self.stage, self._since, self._told, self._doubts = stage, self._now, "", 0
        self._sure_since = self._now

    def _check(self, which: str) -> dict[str, PredicateState]:
        """Check the start or end predicates of the current action."""
        planner, action = self.planner, self.planner.actions[self.number]
        wanted = start_of(planner.task, action) if which == "start" else end_of(planner.task, action)
        state = planner.states[self.number + (which == "end")]
        self.verdicts = check(wanted, self.view, planner.task, state)
        return self.verdicts

    def _wait(self) -> None:
        """Begin the action once its start predicates hold."""
        if self._again and self._waited < BRAKE + self.view.tolerances.window:
            return
        starts = self._check("start")
        if all_hold(starts):
            self._prepare()
            return
        if all_hold(self._check("end")):
            self._end("was done already")
            return
        self.verdicts = starts
        why = first_failing(starts)
        if any(verdict.holds is None for verdict in starts.values()):
            self._sure_since = self._now
        if self._now - self._sure_since > self.settings.grace:
            self._plan_anew(why)
        else:
            self._hold_on(why)

    def _hold_on(self, why: str) -> None:
        """Wait, and say for what; give up when it takes too long."""
        if self._waited > self.settings.patience:
            self._fail(f"waited {self._waited:.0f} s in vain: {why}")
        elif (words := re.sub(r"[\d.]+", "", why)) != self._told and self._waited > 0.5 * self.settings.grace:
            self._told = words
            self.report("waiting", "waiting", f"{why[:1].upper()}{why[1:]}.", {})

    def _prepare(self) -> None:
        """Find the motion of the action, moved to where things are if need be, and begin it."""
        off = self.planner.deviations(self.number, self.view)
        phase = self.planner.planned(self.number)
        if off or self._again:
            try:
                scene = self.planner.scene(self.number, self.view)
            except ObjectUnavailable as error:
                self._hold_on(str(error))
                return
            found = self.planner.retarget(self.number, scene, self.view.now.q)
            if isinstance(found, str):
                self._plan_anew(f"moving this motion is not possible: {found}")
                return
            details = {"cost": found.cost, "why": ", ".join(off) or "from here"}
            self.report("waiting", "retargeted", "The motion is moved to where things are.", details)
            if self._again or not self._moved_before:
                self.shifts.append(RetargetedAction(self.planner.motion, self.number, found))
            phase = found
        self._moved_before = phase.scene is not None
        checked = self._checked(phase)
        if checked is not None:
            self._begin(checked)

    def _checked(self, phase: Phase) -> Phase | None:
        """Return a motion that the robots can execute, or None if there is none."""
        world = self.planner.motion.world
        columns = robot_columns(world)
        broken = violations(world, phase.segment, columns)
        if any(one.kind == "position" for one in broken) or (broken and not self.settings.slow_down):
            self._fail(f"the motion breaks a limit: {broken[0]}")
            return None
        if broken:
            segment, factor = time_scaled(world, phase.segment, columns)
            self.report("waiting", "slowed", f"The motion is slowed down to {1 / factor:.0%}: {broken[0]}", {
                "factor": factor, "limits": [str(one) for one in broken],
            })  # fmt: skip
            phase = replace(phase, segment=segment)
        return phase

    def _begin(self, phase: Phase) -> None:
        action, scene = self.planner.actions[self.number], self.planner.plan.scene
        self.phase, self._again = phase, False
        self._expected = {
            name: at for name in action.arguments if name in scene.objects and (at := self.view.mean(name)) is not None
        }
        believed = self.planner.believed(self.number)
        self._carried = {name: hand for name in scene.objects if (hand := carrier(self.view, name, believed))}
        self._enter("moving")
        self.robots.follow(phase.segment)
        self._line = sentences(scene, self.planner.motion.phases.switches)[self.number]
        details = {"label": action.at(self.number + 1), "seconds": phase.segment.duration}
        self.report("running", "told" if self._line.you else "started", self._line.text, details)

    def _move(self) -> None:
        """Watch the world while the motion goes on; end the action once its end predicates hold."""
        phase = self.phase
        if phase is None or self._disturbed(phase):
            return
        if self._waited < phase.segment.duration:
            return
        for hand, closed in gripper_commands(self.planner.task, self.planner.actions[self.number], self.view):
            self.robots.grip(hand, closed)
        verdicts = self._check("end")
        if all_hold(verdicts):
            self._end("is done")
        elif self._waited > phase.segment.duration + self.settings.patience:
            self._try_again(first_failing(verdicts))
        elif self._waited > phase.segment.duration + self.settings.reminder and not self._told:
            self._told = first_failing(verdicts)
            self.report("waiting", "late", self._line.text, {"why": self._told})

    def _disturbed(self, phase: Phase) -> bool:
        """Stop the robots if the motion has lost its sense; return whether they were stopped."""
        approaching = self._waited < phase.segment.duration
        robot = self._robot_acts()
        for name, expected in self._expected.items() if approaching or not robot else ():
            if robot and self.view.seen(name) is None:
                self._stop("lost", f"{name} is lost from tracking")
                return True
            if name not in self._carried and self._shifted(name, expected) and (robot or self._beyond(name)):
                self._stop("moved", f"{name} was moved")
                return True
        hands = self.planner.plan.scene.hands
        dropped = [
            name
            for name, hand in self._carried.items()
            if hands[hand].agent != "human" and grasped(self.view, hand, name).holds is False
        ]
        self._doubts = self._doubts + 1 if dropped and approaching else 0
        if self._doubts >= SURE:
            for name in dropped:
                self.robots.grip(self._carried[name], False)
            self._stop("dropped", f"{dropped[0]} was dropped")
            return True
        return False

    def _beyond(self, name: str) -> bool:
        """Return whether the human cannot do their action where an object is now; else expect it there."""
        now = self.view.mean(name)
        if now is None or not self.view.table_under(name):
            return False
        self._expected[name] = now
        try:
            scene = self.planner.scene(self.number, self.view)
        except ObjectUnavailable:
            return False
        return isinstance(self.planner.retarget(self.number, scene, self.view.now.q), str)

    def _shifted(self, name: str, expected: TrackedPose) -> bool:
        """Return whether an object has come to rest elsewhere than the motion expects it."""
        now = self.view.mean(name)
        away = np.inf if now is None else np.linalg.norm(now.position - expected.position)
        return bool(away > self.view.tolerances.moved and self.view.rests(name))

    def _stop(self, kind: str, why: str) -> None:
        """Bring the robots to rest; the action begins again from there."""
        phase = self.phase
        if phase is not None:
            since = self._waited
            self.robots.follow(Brake(phase.segment.at(since), phase.segment.velocity(since)))
        self.phase, self._again = None, True
        self._enter("waiting")
        self.report("waiting", kind, f"The robot stops: {why}.", {})

    def _try_again(self, why: str) -> None:
        """Begin the action once more, or give up."""
        self._attempts += 1
        if self._attempts >= self.settings.attempts:
            self._fail(f"{self.planner.actions[self.number].at(self.number + 1)} was not finished in time: {why}")
            return
        for hand, closed in gripper_commands(self.planner.task, self.planner.actions[self.number], self.view):
            if closed:
                self.robots.grip(hand, False)
        self.phase, self._again = None, True
        self._enter("waiting")
        self.report("waiting", "timeout", "This takes too long; once more.", {"why": why})

    def _plan_anew(self, why: str) -> None:
        """Plan the rest again from the world as it is."""
        planner = self.planner
        if self.replans >= self.settings.attempts * len(planner.actions):
            self._fail(f"planned anew {self.replans} times: {why}")
            return
        try:
            scene = planner.scene(self.number, self.view)
        except ObjectUnavailable as error:
            self._hold_on(str(error))
            return
        if self._open_empty():
            return
        self.report("waiting", "planning", "What is left is planned anew.", {"why": why})
        found = planner.anew(self.number, scene, self.view.now.q, self.settings.search)
        if not found.feasible:
            late = f"none was found in {self.settings.search:.0f} s, and {why}"
            self._fail(f"no plan from here: {late if found.status == 'exhausted' else shortened(found.reason)}")
            return
        self.replans += 1
        planner.follow(found)
        self.number, self.phase, self._attempts, self._again = 0, None, 0, False
        self._enter("waiting")
        self.report("waiting", "replanned", f"There is a new plan of {len(found.actions)} actions.", {
            "actions": list(found.actions), "cost": found.costs["total"], "seconds": found.search["seconds"],
            "why": why,
        })  # fmt: skip

    def _open_empty(self) -> bool:
        """Open closed grippers that have nothing in them; return whether there were any."""
        things, reach = self.planner.plan.scene.objects, self.view.tolerances.reach
        empty = [hand for hand in self.view.now.closed if all(self.view.gap(hand, name) > reach for name in things)]
        for hand in empty:
            self.robots.grip(hand, False)
        return bool(empty)

    def resume(self) -> None:
        """Begin the current action from wherever the robots stopped."""
        self._again = True

    def _end(self, how: str) -> None:
        label = self.planner.actions[self.number].at(self.number + 1)
        took = self._waited
        self.report("done", "ended", f"{label} {how}.", {"label": label, "seconds": took})
        self.phase, self._attempts, self._again = None, 0, False
        if self.number + 1 == len(self.planner.actions):
            self._enter("finished")
            self.report("finished", "finished", "All is done.", {})
        else:
            self.number += 1
            self._enter("waiting")

    def _fail(self, why: str) -> None:
        self._enter("failed")
        self.report("failed", "failed", f"{why[:1].upper()}{why[1:]}.", {"why": why})

    def _robot_acts(self) -> bool:
        hands = self.planner.plan.scene.hands
        return any(hands[name].agent != "human" for name in self._action_hands())

    def _action_hands(self) -> list[str]:
        hands = self.planner.plan.scene.hands
        return [name for name in self.planner.actions[self.number].arguments if name in hands]
