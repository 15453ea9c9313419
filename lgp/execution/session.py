"""One run of a plan: connects world, executive, page and log.

plan folder -> `Planner`; simulated or recorded world -> `TrackedWorld` -> `Executive` -> events -> page, log
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lgp.defaults import SCENE_COST
from lgp.errors import LgpError
from lgp.execution.checkpoint import Checkpoint
from lgp.execution.events import Event, Hub
from lgp.execution.executive import Executive, Settings
from lgp.execution.faults import Fault, Faults
from lgp.execution.log import Recorder, RunLog
from lgp.execution.log_reader import LoggedRun, claim, interrupted_run
from lgp.execution.predicates import closed_grippers
from lgp.execution.replay import Replay
from lgp.execution.retarget import Planner, load_plan
from lgp.execution.retarget_cost import retarget_cost
from lgp.execution.ros_messages import JOINT_STATE, encoder
from lgp.execution.simulation import SimulatedRobots, SimulatedTracker, SimulatedWorld
from lgp.execution.tracking import ObservationSource, TrackedWorld
from lgp.execution.worker import Worker, WorkerBehaviour, workers
from lgp.page.sentences import in_words
from lgp.plan_record import Plan

TICK = 0.05
"""[s] Time between observations."""
MAX_LAG = 0.2
"""[s] Largest delay that is made up for; longer ones, as by planning, shift the schedule."""
CHECKPOINT = 0.25
"""[s] Time between checkpoints, besides those at each event."""
LOG = "run.mcap"
"""Name of the log in the folder of the plan."""
REPLANS = "replans"
"""Subfolder of the plan for plans made during a run."""


@dataclass(frozen=True)
class RunOptions:
    """How a plan is run.

    Attributes:
        speed: simulated seconds per second of the clock; 0 for as fast as possible.
        noise: standard deviation of tracked positions [m].
        scatter: standard deviation of initial object positions from the planned ones, in x and y [m].
        replay: recording that replaces the simulated tracker and human.
        cost: dREBA model of new motions; None for motions without ergonomics.
        compare: whether retargeted motions are compared with new plans at the end.
        resume: whether the interrupted run in the folder continues.
    """

    seed: int = 0
    speed: float = 1.0
    settings: Settings = field(default_factory=Settings)
    behaviour: WorkerBehaviour = field(default_factory=WorkerBehaviour)
    noise: float = 0.001
    scatter: float = 0.0
    faults: tuple[Fault, ...] = ()
    replay: Path | None = None
    cost: str | None = SCENE_COST
    compare: bool = True
    resume: bool = False


class ExecutionRun:
    """A run of the plan in a folder, to which the log is written.

    Args:
        on_plan: is called with each plan that comes into force, and its folder.

    Raises:
        LgpError: there is no feasible plan, or no interrupted run to resume.
    """

    def __init__(
        self,
        folder: Path,
        run: RunOptions | None = None,
        on_event: Callable[[Event], None] | None = None,
        on_plan: Callable[[Plan, Path], None] | None = None,
    ) -> None:
        self.folder, self.run = folder, RunOptions() if run is None else run
        self._on_event, self._on_plan = on_event, on_plan
        past = interrupted_run(folder / LOG) if self.run.resume else None
        self.events = [] if past is None else list(past.events)
        self.hub = Hub([event for event in self.events if event.kind != "fault"])
        self._rng = np.random.default_rng([self.run.seed, len(self.events)])
        self.where = folder if past is None else folder / past.state.folder
        self.planner = Planner(load_plan(self.where), self.run.cost)
        self._build(past)
        self._past = past
        self._started = False
        self.log: RunLog

    def start(self) -> None:
        """Open the log, once nothing else can fail; until then no file of the folder changes.

        Raises:
            LgpError: a run of this plan is in progress, or the log cannot be written.
        """
        encoder(JOINT_STATE)  # a missing package is reported before a log is renamed
        self._lock, self._past = claim(self.folder / LOG, self._past)
        self._open(self._past)
        self._started = True

    def go(self) -> dict[str, Any]:
        """Run to the end and return the summary.

        Raises:
            LgpError: the log cannot be written.
        """
        if not self._started:
            self.start()
        speed = self.run.speed
        due = clock.monotonic()
        try:
            while not self.executive.over:
                self._tick()
                if speed > 0.0:
                    due += TICK / speed
                    late = clock.monotonic() - due
                    clock.sleep(max(-late, 0.0))
                    due += late if late > MAX_LAG else 0.0
            return self._summary()
        finally:
            self.close()

    def close(self) -> None:
        """Close the log and unlock the folder."""
        if not self._started:
            return
        self.log.close()
        self._lock.close()
        if self._old is not None:
            self._old.unlink(missing_ok=True)

    def _build(self, past: LoggedRun | None) -> None:
        """Build world, tracker and executive, in the initial state or in that of an interrupted run."""
        world, run = self.planner.motion.world, self.run
        state = None
        if past is not None:
            past.check(self.planner.plan, world, simulated=run.replay is None)
            state = past.state
        q = self.planner.motion.path[0] if state is None else state.q
        self._time = 0.0 if past is None else past.last
        closed = closed_grippers(world.scene, self.planner.nominal(0)) if state is None else state.closed
        self.robots = SimulatedRobots(world, q, closed)
        self.view = TrackedWorld(world)
        rngs = self._rng.spawn(3)
        self.simulation: SimulatedWorld | None = None
        self.workers: tuple[Worker, ...] = ()
        self.faults: Faults | None = None
        if run.replay is not None:
            if run.faults or run.scatter:
                raise LgpError("faults and scatter need a simulated world; leave them out with --replay")
            if run.replay.resolve() == (self.folder / LOG).resolve():
                raise LgpError(
                    f"{run.replay}: the log of this run is written there; copy the recording to another file first"
                )
            self.source: ObservationSource = Replay(run.replay, world, self.robots)
        else:
            self.simulation = SimulatedWorld(world, self.robots, q, state.objects if state else None)
            tracker = SimulatedTracker(self.simulation, rngs[0], run.noise)
            self.source = tracker
            self.workers = workers(self.simulation, run.behaviour, rngs[1])
            faults = run.faults if past is None else ()
            self._check_faults(faults)
            self.faults = Faults(faults, self.simulation, tracker, self.workers, rngs[2])
            if past is None:
                self._scatter(rngs[2])
        number = 0 if state is None else state.number
        self.executive = Executive(self.planner, self.view, self.robots, self._on_executive_event, run.settings, number)
        if state is not None:
            self.executive.replans = state.replans
            self.executive.resume()

    def _open(self, past: LoggedRun | None) -> None:
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
            self._on_executive_event("waiting", "resumed", "The run continues where it was interrupted.", {})
        self._old = None if past is None else past.file

    def _tick(self) -> None:
        self._time += TICK
        if isinstance(self.source, Replay):
            self.robots.step(self._time)
            self.source.time = self._time
        for worker in self.workers:
            worker.step(self._time)
        if self.simulation is not None:
            self.simulation.step(self._time)
        if self.faults is not None:
            for text in self.faults.step(self._time):
                words = in_words(self.planner.plan.scene, text)
                self._on_executive_event(self.events[-1].state, "fault", words, {})
        self.view.add(self.source.observe())
        self.recorder.moment(self.view, self.planner.nominal(self.executive.number))
        self.executive.step()
        self.recorder.predicates(self._time, self.executive.number, self.executive.predicate_states)
        if self._time - self._saved >= CHECKPOINT:
            self._save()

    def _on_executive_event(self, state: str, kind: str, text: str, details: dict[str, Any]) -> None:
        """Log an event, pass it to the page, and start the motion of persons and the faults of the action."""
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
            self.recorder.command(self._time, executive.phase.trajectory)
            for worker in self.workers:
                worker.on_action(self.planner, executive.number, executive.phase)
            if self.faults is not None and executive.replans == 0:
                for one in self.planner.step(executive.number):
                    self.faults.on_start(one, self.planner.actions[one], executive.phase.trajectory.duration)
        if self._on_event is not None:
            self._on_event(event)
        self._save()

    def _follow(self, plan: Plan, where: Path) -> None:
        self.where = where
        self.recorder.plan(self._time, plan, self._relative())
        if self._on_plan is not None:
            self._on_plan(plan, where)

    def _relative(self) -> str:
        return self.where.relative_to(self.folder).as_posix()

    def _save(self) -> None:
        self._saved = self._time
        executive, robots = self.executive, self.robots
        q = self.source.observe().q if self.simulation is None else self.simulation.q
        objects = {} if self.simulation is None else self.simulation.objects
        state = Checkpoint(
            epoch=self.log.epoch,
            time=self._time,
            q=q,
            closed=frozenset(robots.closed),
            objects=objects,
            number=executive.number,
            folder=self._relative(),
            replans=executive.replans,
        )
        self.log.json("/state", self._time, state.record())
        self.log.flush()

    def _scatter(self, rng: np.random.Generator) -> None:
        """Displace all objects on tables at random."""
        simulation = self.simulation
        if simulation is None or self.run.scatter <= 0.0:
            return
        for name, scene_object in simulation.world.scene.objects.items():
            if not scene_object.hand:
                half = np.array(simulation.world.scene.tables[scene_object.on].size) / 2.0
                x, y = np.clip(np.array(scene_object.at[:2]) + rng.normal(0.0, self.run.scatter, 2), -half, half)
                simulation.lay(name, scene_object.on, float(x), float(y))

    def _check_faults(self, faults: tuple[Fault, ...]) -> None:
        count = len(self.planner.actions)
        for fault in faults:
            if fault.action >= count:
                raise LgpError(f"fault {fault.kind}@{fault.action + 1}: the plan has {count} actions")

    def _summary(self) -> dict[str, Any]:
        """Return the summary of the run, with the costs of retargeted motions beside those of new plans."""
        events, comparisons = self.events, []
        if self.run.compare and self.executive.stage == "finished":
            for retargeted in self.executive.retargeted:
                comparison = retarget_cost(self.planner, retargeted, self.run.settings.search)
                comparisons.append(comparison)
                self.log.json("/comparison", self._time, comparison)
        kinds = [event.kind for event in events]
        return {
            "state": self.executive.stage,
            "why": events[-1].details.get("why", "") if events else "",
            "seconds": self._time,
            "actions": [
                label for one in events if one.kind == "ended" for label in one.details["label"].split(" and ")
            ],
            "retargeted": kinds.count("retargeted"),
            "replanned": kinds.count("replanned"),
            "stops": {kind: kinds.count(kind) for kind in ("moved", "dropped", "lost", "timeout")},
            "slowed": kinds.count("slowed"),
            "comparison": comparisons,
            "output": str(self.folder / LOG),
        }
