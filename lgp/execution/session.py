"""One run from beginning to end: everything is put together here.

plan folder -> Planner; simulated or replayed world -> View -> Executive -> events -> page, log
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgp.errors import LgpError
from lgp.execution.events import Event, Hub
from lgp.execution.executive import Executive, RetargetedAction, Settings
from lgp.execution.faults import Fault, Faults
from lgp.execution.fixed_path import FixedPathBounds, holding_hands
from lgp.execution.log import Recorder, RunLog
from lgp.execution.log_reader import Past, attachments, checkpoint, continue_log
from lgp.execution.predicates import gripper_commands
from lgp.execution.replay import Replay
from lgp.execution.retarget import Phase, Planner, load_plan
from lgp.execution.simulation import SimulatedRobots, SimulatedTracker, SimulatedWorld
from lgp.execution.tracking import Observation, ObservationSource, TrackedPose, TrackedWorld
from lgp.execution.worker import Worker, WorkerBehaviour
from lgp.kinematics.modes import ModeSequence
from lgp.path.phases import Phases
from lgp.plan_record import Plan
from lgp.planner import COST
from lgp.scene.model import Scene
from lgp.search.tree_search import BoundResult

TICK = 0.05
"""[s] Between observations."""
LATE = 0.2
"""[s] The clock is caught up with after shorter delays only."""
STATE = 0.25
"""[s] Between checkpoints, besides those at every event."""
LOG = "run.mcap"
"""The log, in the folder of the plan."""
REPLANS = "replans"
"""Folder of the plans that were made during a run, in that of the plan."""
Told = Callable[[Event], None]


@dataclass(frozen=True)
class RunOptions:
    """How a plan is run.

    Attributes:
        seed: of everything random.
        speed: simulated seconds in one of the clock; 0 for as fast as possible.
        settings: patience of the executive.
        habits: of the simulated human.
        noise: standard deviation of tracked positions [m].
        scatter: standard deviation of where objects lie at first from where it was planned, in x and y [m].
        faults: what is to go wrong.
        replay: recording that is watched instead of a simulated tracker and human.
        cost: dREBA model of new motions.
        compare: whether moved motions are compared with new plans at the end.
        resume: whether the unfinished run in the folder goes on.
    """

    seed: int = 0
    speed: float = 1.0
    settings: Settings = field(default_factory=Settings)
    habits: WorkerBehaviour = field(default_factory=WorkerBehaviour)
    noise: float = 0.001
    scatter: float = 0.0
    faults: tuple[Fault, ...] = ()
    replay: Path | None = None
    cost: str | None = COST
    compare: bool = True
    resume: bool = False


class ExecutionRun:
    """A run of the plan in a folder.

    Args:
        folder: with the plan; the log goes there.
        run: how it is run.
        told: is called with every event.
        planned: is called with every plan that is followed from then on, and its folder.

    Raises:
        LgpError: there is no plan, it is not feasible, or there is nothing to resume.

    Example:
        >>> Session(Path("plan"), Run(speed=0)).go()["state"]               # doctest: +SKIP
        'finished'
    """

    def __init__(
        self,
        folder: Path,
        run: RunOptions | None = None,
        told: Told | None = None,
        planned: Callable[[Plan, Path], None] | None = None,
    ) -> None:
        self.folder, self.run = folder, RunOptions() if run is None else run
        self._told, self._planned = told, planned
        past = continue_log(folder / LOG) if self.run.resume else None
        self.events = [] if past is None else list(past.events)
        self.hub = Hub([event for event in self.events if event.kind != "fault"])
        self._rng = np.random.default_rng([self.run.seed, len(self.events)])
        self.where = folder if past is None else folder / past.state["folder"]
        self.planner = Planner(load_plan(self.where), self.run.cost)
        self._build(past)
        self._open(past)

    def go(self) -> dict[str, Any]:
        """Run to the end and return what happened.

        Raises:
            LgpError: the log cannot be written.
        """
        speed = self.run.speed
        due = clock.monotonic()
        try:
            while not self.executive.over:
                self._tick()
                if speed > 0.0:
                    due += TICK / speed
                    late = clock.monotonic() - due
                    clock.sleep(max(-late, 0.0))
                    # Time spent on planning is not made up for.
                    due += late if late > LATE else 0.0
            return self._summary()
        finally:
            self.close()

    def close(self) -> None:
        """Close the log."""
        self.log.close()
        if self._old is not None:
            self._old.unlink(missing_ok=True)

    def _build(self, past: Past | None) -> None:
        """Build the world, its tracker and the executive, at the beginning or where an earlier run stopped."""
        world, run = self.planner.motion.world, self.run
        state = {} if past is None else past.state
        q = np.array(state["q"]) if state else self.planner.motion.path[0]
        self._time = 0.0 if past is None else past.last
        self.robots = SimulatedRobots(world, q, frozenset(state.get("closed", ())))
        self.view = TrackedWorld(world)
        rngs = self._rng.spawn(3)
        self.simulation: SimulatedWorld | None = None
        self.worker: Worker | None = None
        self.faults: Faults | None = None
        if run.replay is not None:
            if run.faults or run.scatter:
                raise LgpError("faults and scatter belong to a simulated world; leave them out with a replay")
            if run.replay.resolve() == (self.folder / LOG).resolve():
                raise LgpError(
                    f"{run.replay}: the log of this run goes there; copy the recording to another place first"
                )
            self.source: ObservationSource = Replay(run.replay, world, self.robots)
        else:
            self.simulation = SimulatedWorld(world, self.robots, q, attachments(state) if state else None)
            tracker = SimulatedTracker(self.simulation, rngs[0], run.noise)
            self.source = tracker
            if world.scene.human is not None:
                self.worker = Worker(self.simulation, run.habits, rngs[1])
            faults = run.faults if past is None else ()
            self._check_faults(faults)
            self.faults = Faults(faults, self.simulation, tracker, self.worker, rngs[2])
            if past is None:
                self._scatter(rngs[2])
        number = int(state.get("number", 0))
        self.executive = Executive(self.planner, self.view, self.robots, self._report, run.settings, number)
        if state:
            self.executive.replans = int(state["replans"])
            self.executive.resume()

    def _open(self, past: Past | None) -> None:
        epoch = clock.time() if past is None else past.epoch
        self._saved = -np.inf
        about = {"plan": self.planner.plan.scene.name, "seed": str(self.run.seed)}
        self.log = RunLog(self.folder / LOG, epoch, about)
        self.recorder = Recorder(self.log, self.planner.motion.world)
        if past is None:
            self._number = 0
            self._follow(self.planner.plan, self.where)
        else:
            self._number = past.events[-1].number if past.events else 0
            past.copy_into(self.log)
            self._report("waiting", "resumed", "The run goes on where it was interrupted.", {})
        self._old = None if past is None else past.file

    def _tick(self) -> None:
        self._time += TICK
        if isinstance(self.source, Replay):
            self.robots.step(self._time)
            self.source.time = self._time
        if self.worker is not None:
            self.worker.step(self._time)
        if self.simulation is not None:
            self.simulation.step(self._time)
        if self.faults is not None:
            for text in self.faults.step(self._time):
                self._report(self.events[-1].state, "fault", text, {})
        self.view.add(self.source.observe())
        self.recorder.moment(self.view, self.planner.believed(self.executive.number))
        self.executive.step()
        self.recorder.predicates(self._time, self.executive.number, self.executive.verdicts)
        if self._time - self._saved >= STATE:
            self._save()

    def _report(self, state: str, kind: str, text: str, details: dict[str, Any]) -> None:
        """Take in what the executive says."""
        executive = self.executive
        number = None if state == "finished" else executive.number
        if kind == "replanned":
            where = self.folder / REPLANS / str(executive.replans)
            self.planner.plan.save(where)
            self._follow(self.planner.plan, where)
        self._number += 1
        event = Event(self._number, self._time, number, state, kind, text, details, executive.replans)
        self.events.append(event)
        if kind != "fault":
            self.hub.add(event)
        self.recorder.event(event)
        if kind in ("told", "started") and executive.phase is not None:
            self.recorder.command(self._time, executive.phase.segment)
            if self.worker is not None:
                self.worker.told(self.planner, executive.number, executive.phase)
            if self.faults is not None and executive.replans == 0:
                action = self.planner.actions[executive.number]
                self.faults.told(executive.number, action, executive.phase.segment.duration)
        if self._told is not None:
            self._told(event)
        self._save()

    def _follow(self, plan: Plan, where: Path) -> None:
        self.where = where
        self.recorder.plan(self._time, plan, self._relative())
        if self._planned is not None:
            self._planned(plan, where)

    def _relative(self) -> str:
        return self.where.relative_to(self.folder).as_posix()

    def _save(self) -> None:
        self._saved = self._time
        executive, robots = self.executive, self.robots
        q = self.source.observe().q if self.simulation is None else self.simulation.q
        things = {} if self.simulation is None else self.simulation.things
        state = checkpoint(self.log.epoch, self._time, q, robots.closed, things)
        state |= {"number": executive.number, "folder": self._relative(), "replans": executive.replans}
        self.log.json("/state", self._time, state)
        self.log.flush()

    def _scatter(self, rng: np.random.Generator) -> None:
        """Put every object a little off its place."""
        simulation = self.simulation
        if simulation is None or self.run.scatter <= 0.0:
            return
        for name, thing in simulation.world.scene.things.items():
            if not thing.hand:
                half = np.array(simulation.world.scene.tables[thing.on].size) / 2.0
                x, y = np.clip(np.array(thing.at[:2]) + rng.normal(0.0, self.run.scatter, 2), -half, half)
                simulation.lay(name, thing.on, float(x), float(y))

    def _check_faults(self, faults: tuple[Fault, ...]) -> None:
        count = len(self.planner.actions)
        for fault in faults:
            if fault.action >= count:
                raise LgpError(f"fault {fault.kind}@{fault.action + 1}: the plan has {count} actions")

    def _summary(self) -> dict[str, Any]:
        """Return what happened, with the costs of what was moved beside those of new plans."""
        events, compared = self.events, []
        if self.run.compare and self.executive.stage == "finished":
            for shift in self.executive.shifts:
                found = compare(self.planner, shift, self.run.settings.search)
                compared.append(found)
                self.log.json("/comparison", self._time, found)
        kinds = [event.kind for event in events]
        return {
            "state": self.executive.stage,
            "why": events[-1].details.get("why", "") if events else "",
            "seconds": self._time,
            "actions": [event.details["label"] for event in events if event.kind == "ended"],
            "retargeted": kinds.count("retargeted"),
            "replanned": kinds.count("replanned"),
            "stops": {kind: kinds.count(kind) for kind in ("moved", "dropped", "lost", "timeout")},
            "slowed": kinds.count("slowed"),
            "comparison": compared,
            "output": str(self.folder / LOG),
        }


def compare(planner: Planner, shift: RetargetedAction, seconds: float) -> dict[str, Any]:
    """Return the costs of a moved motion with its greedy rest, of a new plan, and their difference.

    The new plan is the better of two: what a search finds, and the greedy rest optimised as a whole, as solutions of
    path problems are local.

    Args:
        planner: of the run.
        shift: the motion that was moved.
        seconds: wall-clock time for the search.

    Returns:
        action, greedy, anew, extra (greedy - anew), share (extra / anew), actions of the new plan, whether they differ
        from those that were left; costs are None where there is no such path.
    """
    own = planner.as_it_is()
    own.use(shift.motion)
    phase, scene = shift.phase, shift.phase.scene
    left = [str(action) for action in own.actions[shift.number :]]
    found: dict[str, Any] = {"action": own.actions[shift.number].at(shift.number + 1), "extra": None, "share": None}
    if scene is None:
        return found
    rest = _greedy(own, shift.number, phase)
    greedy, whole = (None, None) if rest is None else _costs(own, shift.number, scene, rest)
    new = own.anew(shift.number, scene, phase.segment.knots[0], seconds, thorough=True)
    labels = [label.replace(f"({at + 1}, ", "(") for at, label in enumerate(new.actions)]
    anew = float(new.costs["total"]) if new.feasible else None
    if whole is not None and (anew is None or whole < anew):
        anew, labels = whole, left
    found |= {"greedy": greedy, "anew": anew, "actions": labels, "same_actions": labels == left}
    if greedy is not None and anew is not None:
        found |= {"extra": greedy - anew, "share": (greedy - anew) / anew}
    return found


def _greedy(planner: Planner, number: int, phase: Phase) -> list[Phase] | None:
    """Return the moved motion and all later ones, each moved in its turn; None if one is infeasible."""
    found = [phase]
    for later in range(number + 1, len(planner.actions)):
        view = _after(planner, later - 1, found[-1])
        following = planner.retarget(later, planner.scene(later, view), view.now.q, pause=True)
        if isinstance(following, str):
            return None
        found.append(following)
    return found


def _costs(planner: Planner, number: int, scene: Scene, rest: list[Phase]) -> tuple[float, float | None]:
    """Return the cost of motions one after the other, and when they are optimised as a whole (None: it failed)."""
    solutions = [phase.solution for phase in rest if phase.solution is not None]
    keys = np.stack([phase.segment.knots[-1] for phase in rest])
    variables = np.concatenate([solution.variables for solution in solutions])
    path = np.concatenate([phase.segment.knots[1:] for phase in rest])
    world, start = planner.motion.world.with_scene(scene), rest[0].segment.knots[0]
    slices = planner.motion.phases.slices
    bounds = FixedPathBounds(
        world,
        planner.ergonomics(),
        initial_configuration=start,
        slices=slices,
        collisions=planner.apart,
        holding=holding_hands(planner.motion.modes, number),
    )
    actions = planner.actions[number:]
    problem = bounds.problem("path", bounds.phases(actions))
    greedy = problem.costs(problem.join(path, variables)).total
    first = replace(solutions[-1], keyframes=keys, variables=variables, path=None)
    found = bounds.solve("path", actions, BoundResult(True, greedy, payload=first))
    return greedy, found.cost if found.feasible else None


def _after(planner: Planner, number: int, phase: Phase) -> TrackedWorld:
    """Return the world as it is after a moved motion, as if it had been tracked at rest for a while."""
    scene, action = phase.scene, planner.actions[number]
    if scene is None or phase.solution is None:
        raise LgpError("only a motion that was moved knows the world it ends in")
    world, q = planner.motion.world.with_scene(scene), phase.segment.knots[-1]
    modes = ModeSequence(world, Phases.of(scene, (action,)).switches)
    kinematics = world.at(q[None], modes.frames)
    poses = {}
    for name in scene.things:
        pose = modes.pose(name, 1, kinematics, phase.solution.variables)
        poses[name] = pose.rotation[0], pose.position[0]
    view = TrackedWorld(world)
    closed = {thing.hand for thing in scene.things.values() if thing.hand and not thing.hand.startswith("human.")}
    for time in (0.0, view.tolerances.window):
        things = {name: TrackedPose(*pose, time) for name, pose in poses.items()}
        view.add(Observation(time, q, things, frozenset(closed)))
        for hand, shut in gripper_commands(planner.task, action, view):
            (closed.add if shut else closed.discard)(hand)
    view.add(Observation(view.now.time, q, view.now.things, frozenset(closed)))
    return view
