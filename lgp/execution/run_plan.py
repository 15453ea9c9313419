"""`lgp.run_plan`: execute a saved plan in the simulated world, as `lgp run --no-page` does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lgp.defaults import SCENE_COST
from lgp.errors import LgpError
from lgp.execution.events import Event
from lgp.execution.session import ExecutionRun, RunOptions
from reba.checks import NOT_NEGATIVE, PATH, SEED, YES_NO, Allowed, accepts

_CALLBACK = Allowed("a function, or None", lambda value: value is None or callable(value))


@accepts(LgpError, folder=PATH, seed=SEED, speed=NOT_NEGATIVE, resume=YES_NO, on_event=_CALLBACK)
def run_plan(
    folder: str | Path,
    *,
    seed: int = 0,
    speed: float = 0.0,
    cost: str = SCENE_COST,
    resume: bool = False,
    on_event: Callable[[Event], None] | None = None,
) -> dict[str, Any]:
    """Execute the plan in a folder: follow the tracked world, retarget or replan, and log to `run.mcap` there.

    Args:
        folder: what `Plan.save` wrote.
        seed: of the simulated people, robots and tracker.
        speed: 1 runs in real time, 0 as fast as possible.
        cost: surrogate of new motions, a shipped name or a file, by default that of the scene.
        resume: continue the interrupted run of this folder.
        on_event: called with each event of the run.

    Returns:
        The summary that `lgp run --json` prints: state, events, retargeted motions and their cost.

    Raises:
        LgpError: there is no plan, a package is missing, or the log cannot be written.
    """
    options = RunOptions(seed=seed, speed=speed, cost=cost, resume=resume)
    return ExecutionRun(Path(folder), options, on_event).go()
