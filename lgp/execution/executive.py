"""The executive: state machine that follows a plan action by action, by predicates on the tracked world.

waiting -> (start predicates hold) -> moving -> (motion over, end predicates hold) -> next action
Deviations: an object is not at its planned pose -> the motion is retargeted; the world contradicts the plan or the
motion is infeasible -> the remaining actions are replanned; a time limit passes -> the action is repeated, then the run
fails.
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
    closing_grippers,
    end_of,
    first_failing,
    gripper_commands,
    start_of,
)
from lgp.execution.replan import first_reasons
from lgp.execution.retarget import ActionMotion, Planner
from lgp.execution.simulation import Robots
from lgp.execution.tracked_scene import ObjectUnavailable, carrier
from lgp.execution.tracking import TrackedPose, TrackedWorld
from lgp.execution.trajectory import BRAKE, Brake, robot_columns, time_scaled, violations
from lgp.logic.task import Action
from lgp.motion import Motion
from lgp.page.sentences import Instruction, in_words, instructions
from lgp.page.steps import with_steps

OnEvent = Callable[[str, str, str, dict[str, Any]], None]
"""Callback with the state, kind, text and details of an event, see `events.Event`."""
DROP_OBSERVATIONS = 3
"""Number of successive observations without an object in the hand that count as a drop, against tracker noise."""
OUT_OF_REACH = "an object is where the planned motion does not reach it"
"""Why there is a new plan, for people, where no disturbance was seen."""


@dataclass(frozen=True)
class Settings:
    """Time limits and attempts of the executive.

    Attributes:
        patience: largest wait for the start of an action, and largest excess of its duration over its motion [s].
        reminder: excess of its duration after which the page says that the action is late [s].
        grace: time after which a start predicate that does not hold contradicts the plan [s].
        search: wall-clock time of the search for a new plan [s].
        slow_down: whether motions above the velocity limits of a robot are slowed down; otherwise the run fails.
    """

    patience: float = 15.0
    reminder: float = 2.0
    grace: float = 1.0
    attempts: int = 2
    search: float = 20.0
    slow_down: bool = True


@dataclass(frozen=True)
class RetargetedAction:
    """A retargeted motion: the plan and number of its action, and the new motion."""

    motion: Motion
    number: int
    phase: ActionMotion


class Executive:
    """State machine that follows a plan; the caller adds an observation to `view` before each `step`.

    Attributes:
        number: of the current action, the first one of those that happen at the same time.
        stage: waiting, moving, finished or failed.
        phase: motion of the current action, None while waiting.
        replans: number of times the remaining actions were replanned.
        retargeted: motions retargeted because the world had changed, not because the one before was retargeted.
        predicate_states: of the predicates that were checked last.
    """

    def __init__(
        self,
        planner: Planner,
        view: TrackedWorld,
        robots: Robots,
        on_event: OnEvent,
        settings: Settings | None = None,
        number: int = 0,
    ) -> None:
        self.planner, self.view, self.robots, self.on_event = planner, view, robots, on_event
        self.settings = Settings() if settings is None else settings
        self.number, self.stage = number, "waiting"
        self.phase: ActionMotion | None = None
        self.replans = 0
        self.retargeted: list[RetargetedAction] = []
        self.predicate_states: dict[str, PredicateState] = {}
        self._since: float | None = None
        self._attempts = 0
        self._restarts = self._previous_retargeted = False
        self._last_reason = self._stopped_by = ""
        self._drop_observations = 0
        self._known_since = 0.0

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        return self.stage in ("finished", "failed")

    def step(self) -> None:
        """Advance by one observation."""
        if self._since is None:
            self._since = self._now
        if self.number == len(self.planner.actions):
            self._finish("The goal is reached already.")
        elif self.stage == "waiting" and self.view.settled():
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
        self.stage, self._since, self._last_reason, self._drop_observations = stage, self._now, "", 0
        self._known_since = self._now

    def _check(self, which: str) -> dict[str, PredicateState]:
        """Return the states of the start or end predicates of the current actions."""
        planner, of_action = self.planner, start_of if which == "start" else end_of
        predicates = tuple(one for action in self._actions for one in of_action(planner.task, action))
        state = planner.states[self.number if which == "start" else planner.step(self.number).stop]
        self.predicate_states = check(predicates, self.view, planner.task, state)
        return self.predicate_states

    def _wait(self) -> None:
        """Start the action once its start predicates hold."""
        if self._restarts and self._waited < BRAKE + self.view.tolerances.window:
            return
        starts = self._check("start")
        if all_hold(starts):
            self._prepare()
            return
        if all_hold(self._check("end")):
            self._end("Done already")
            return
        self.predicate_states = starts
        why = first_failing(starts)
        if any(state.holds is None for state in starts.values()):
            self._known_since = self._now
        if self._now - self._known_since > self.settings.grace:
            self._replan(why)
        else:
            self._wait_for(why)

    def _wait_for(self, why: str) -> None:
        """Report the reason of the wait; fail after the time limit."""
        if self._waited > self.settings.patience:
            self._fail(f"waited {self._waited:.0f} s, limit {self.settings.patience:.0f} s: {why}")
        elif (reason := re.sub(r"[\d.]+", "", why)) != self._last_reason and self._waited > 0.5 * self.settings.grace:
            self._last_reason = reason
            self.on_event("waiting", "waiting", self._please_wait(why), {"why": why})

    def _prepare(self) -> None:
        """Start the motion of the action, retargeted if the world deviates from the plan."""
        deviations = self.planner.deviations(self.number, self.view)
        phase = self.planner.planned(self.number)
        if deviations or self._restarts:
            try:
                scene = self.planner.scene(self.number, self.view)
            except ObjectUnavailable as error:
                self._wait_for(str(error))
                return
            retargeted: ActionMotion | str = "several actions at the same time are planned again"
            if len(self._actions) == 1:
                retargeted = self.planner.retarget(self.number, scene, self.view.now.q)
            if isinstance(retargeted, str):
                self._replan(f"the motion cannot be retargeted: {retargeted}", self._stopped_by or OUT_OF_REACH)
                return
            details = {"cost": retargeted.cost, "why": ", ".join(deviations) or "start from here"}
            self.on_event("waiting", "retargeted", "The motion is adapted to where the objects are.", details)
            if self._restarts or not self._previous_retargeted:
                self.retargeted.append(RetargetedAction(self.planner.motion, self.number, retargeted))
            phase = retargeted
        self._previous_retargeted = phase.scene is not None
        executable = self._within_limits(phase)
        if executable is not None:
            self._begin(executable)

    def _within_limits(self, phase: ActionMotion) -> ActionMotion | None:
        """Return the motion slowed down to the velocity limits of the robots; fail and return None if not allowed."""
        world = self.planner.motion.world
        columns = robot_columns(world)
        violated = violations(world, phase.trajectory, columns)
        if any(one.kind == "position" for one in violated) or (violated and not self.settings.slow_down):
            self._fail(f"the motion exceeds a limit: {violated[0]}")
            return None
        if violated:
            trajectory, factor = time_scaled(world, phase.trajectory, columns)
            self.on_event("waiting", "slowed", f"The robot moves at {100 / factor:.0f} % of the planned speed.", {
                "why": str(violated[0]), "factor": factor, "limits": [str(one) for one in violated],
            })  # fmt: skip
            phase = replace(phase, trajectory=trajectory)
        return phase

    def _begin(self, phase: ActionMotion) -> None:
        scene = self.planner.plan.scene
        self.phase, self._restarts, self._stopped_by = phase, False, ""
        names = [name for action in self._actions for name in action.arguments if name in scene.objects]
        self._expected = {name: at for name in names if (at := self.view.lies(name)) is not None}
        nominal = self.planner.nominal(self.number)
        self._carried = {name: hand for name in scene.objects if (hand := carrier(self.view, name, nominal))}
        self._enter("moving")
        self.robots.follow(phase.trajectory)
        details = {"label": self._label, "seconds": phase.trajectory.duration}
        self.on_event("running", "told" if self._instruction.you else "started", self._instruction.text, details)

    def _move(self) -> None:
        """Watch for disturbances during the motion; end the action once its end predicates hold."""
        phase = self.phase
        if phase is None or self._disturbed(phase):
            return
        if self._waited < phase.trajectory.duration:
            return
        for action in self._actions:
            for hand, closed in gripper_commands(self.planner.task, action, self.view):
                self.robots.grip(hand, closed)
        ends = self._check("end")
        if all_hold(ends):
            self._end("Done")
        elif self._waited > phase.trajectory.duration + self.settings.patience:
            self._repeat(first_failing(ends))
        elif self._waited > phase.trajectory.duration + self.settings.reminder and not self._last_reason:
            self._last_reason = first_failing(ends)
            self.on_event("waiting", "late", self._instruction.text, {"why": self._last_reason})

    def _disturbed(self, phase: ActionMotion) -> bool:
        """Stop the robots if an object was lost, moved or dropped; return whether they were stopped."""
        approaching = self._waited < phase.trajectory.duration
        robot = self._robot_acts()
        for name, expected in self._expected.items() if approaching or not robot else ():
            if robot and self.view.seen(name) is None:
                self._stop("lost", f"{name} is lost from tracking")
                return True
            if name not in self._carried and self._displaced(name, expected) and (robot or self._unreachable(name)):
                self._stop("moved", f"{name} was moved")
                return True
        seen = [(name, hand) for name, hand in self._carried.items() if self.view.seen(name) is not None]
        dropped = [name for name, hand in seen if self.view.gap(hand, name) > self.view.tolerances.reach]
        self._drop_observations = self._drop_observations + 1 if dropped and approaching else 0
        if self._drop_observations >= DROP_OBSERVATIONS:
            for hand in self.view.now.closed.intersection(self._carried[name] for name in dropped):
                self.robots.grip(hand, False)
            self._stop("dropped", f"{dropped[0]} was dropped")
            return True
        return False

    def _unreachable(self, name: str) -> bool:
        """Return whether the human cannot reach a displaced object; if they can, expect it at its new pose."""
        now = self.view.lies(name)
        if now is None or not self.view.table_under(name):
            return False
        self._expected[name] = now
        try:
            scene = self.planner.scene(self.number, self.view)
        except ObjectUnavailable:
            return False
        return isinstance(self.planner.retarget(self.number, scene, self.view.now.q), str)

    def _displaced(self, name: str, expected: tuple[str, TrackedPose]) -> bool:
        """Return whether an object rests away from where the motion expects it, on a table that a robot carries too."""
        on, at = self.view.lies(name) or ("", None)
        away = np.inf if at is None or on != expected[0] else np.linalg.norm(at.position - expected[1].position)
        return bool(away > self.view.tolerances.moved and self.view.rests(name))

    def _stop(self, kind: str, why: str) -> None:
        """Bring the robots to rest; the action restarts from there."""
        phase = self.phase
        if phase is not None:
            since = self._waited
            self.robots.follow(Brake(phase.trajectory.at(since), phase.trajectory.velocity(since)))
        self.phase, self._restarts, self._stopped_by = None, True, why
        self._enter("waiting")
        self.on_event("waiting", kind, self._please_wait(why), {"why": why})

    def _repeat(self, why: str) -> None:
        """Repeat the action, or fail after the last attempt."""
        self._attempts += 1
        if self._attempts >= self.settings.attempts:
            self._fail(f"{self._label} was not finished in time: {why}", f"This step was not finished in time: {why}")
            return
        for action in self._actions:
            for hand, _ in closing_grippers(self.planner.plan.scene, self.planner.task, action):
                self.robots.grip(hand, False)
        self.phase, self._restarts = None, True
        self._enter("waiting")
        self.on_event("waiting", "timeout", "The action takes too long and is repeated.", {"why": why})

    def _replan(self, why: str, words: str = "") -> None:
        """Replan the remaining actions from the tracked world; people read `words`, by default the reason itself."""
        planner = self.planner
        if self.replans >= self.settings.attempts * len(planner.actions):
            self._fail(f"replanned {self.replans} times without success: {why}")
            return
        try:
            scene = planner.scene(self.number, self.view)
        except ObjectUnavailable as error:
            self._wait_for(str(error))
            return
        if self._open_empty():
            return
        self.on_event(
            "waiting", "planning", self._please_wait(f"{words or why}; a new plan is being made"), {"why": why}
        )
        plan = planner.replan(self.number, scene, self.view.now.q, self.settings.search)
        if not plan.feasible:
            timeout = f"none was found in {self.settings.search:.0f} s, and {why}"
            reason = timeout if plan.status == "exhausted" else first_reasons(plan.reason)
            self._fail(f"no plan from here: {reason}", f"{words or why}; no new plan was found")
            return
        if not plan.actions:
            self._finish("The goal is reached already.")
            return
        self.replans += 1
        planner.follow(plan)
        self.number, self.phase, self._attempts, self._restarts = 0, None, 0, False
        self._enter("waiting")
        self.on_event("waiting", "replanned", "There is a new plan.", {
            "actions": list(plan.actions), "cost": plan.costs["total"], "seconds": plan.search["seconds"],
            "why": why,
        })  # fmt: skip

    def _please_wait(self, why: str) -> str:
        """Return the sentence for a person while the instruction of the action does not count."""
        return f"Please wait. {in_words(self.planner.plan.scene, why)}."

    def _open_empty(self) -> bool:
        """Open closed grippers without an object; return whether there were any."""
        object_names, reach = self.planner.plan.scene.objects, self.view.tolerances.reach
        empty = [
            hand for hand in self.view.now.closed if all(self.view.gap(hand, name) > reach for name in object_names)
        ]
        for hand in empty:
            self.robots.grip(hand, False)
        return bool(empty)

    def resume(self) -> None:
        """Restart the current action from the present configuration of the robots."""
        self._restarts = True

    def _end(self, how: str) -> None:
        label, following = self._label, self.planner.step(self.number).stop
        self.on_event("done", "ended", f"{how}: {self._instruction.text}", {"label": label, "seconds": self._waited})
        self.phase, self._attempts, self._restarts = None, 0, False
        if following == len(self.planner.actions):
            self._finish("All actions are done.")
            return
        self.number = following
        self._enter("waiting")

    def _finish(self, text: str) -> None:
        self._enter("finished")
        self.on_event("finished", "finished", text, {})

    def _fail(self, why: str, words: str = "") -> None:
        self._enter("failed")
        self.on_event("failed", "failed", f"{in_words(self.planner.plan.scene, words or why)}.", {"why": why})

    def _robot_acts(self) -> bool:
        hands = self.planner.plan.scene.hands
        names = {name for action in self._actions for name in action.arguments}
        return any(not hands[name].human for name in names.intersection(hands))

    @property
    def _actions(self) -> tuple[Action, ...]:
        """The current actions: those of one phase."""
        return tuple(self.planner.actions[number] for number in self.planner.step(self.number))

    @property
    def _instruction(self) -> Instruction:
        """What the page says, with the steps of the motion that is made."""
        phases, phase = self.planner.motion.phases, self.phase or self.planner.planned(self.number)
        line = instructions(phases)[phases.phase_of[self.number]]
        return with_steps([line], self.planner.motion.world, phase.trajectory.knots[[0, -1]])[0]

    @property
    def _label(self) -> str:
        """The current actions as a plan prints them."""
        return " and ".join(map(self.planner.motion.phases.label, self.planner.step(self.number)))
