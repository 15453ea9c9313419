"""Logs of interrupted runs are files as any other: what no run writes is refused in one line, and leads nowhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.execution.checkpoint import Checkpoint
from lgp.execution.log import RunLog
from lgp.execution.log_reader import interrupted_run
from lgp.execution.simulation import Placement
from tests.support.says import says

RECORD = Checkpoint(
    epoch=1.7e9,
    time=0.25,
    q=np.zeros(2),
    closed=frozenset({"human.right_hand"}),
    objects={"box": Placement("human.right_hand", np.eye(3), np.zeros(3))},
    number=0,
    folder=".",
    replans=0,
).record()
EVENT = {"number": 1, "time": 0.0, "action": 0, "state": "running", "kind": "started", "text": "Grasp.", "plan": 0}


def log_of(file: Path, topic: str, value: Any) -> None:
    """Write a log with one record."""
    with RunLog(file, 1.7e9, {}) as log:
        log.json(topic, 0.0, value)


def changed(data: dict[str, Any], *path: Any, value: Any) -> dict[str, Any]:
    """Return nested data with one value replaced."""
    first, *rest = path
    return {**data, first: changed(data[first], *rest, value=value) if rest else value}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        *[((name,), None) for name in ("epoch", "time", "q", "closed", "number", "folder", "replans")],
        *[((name,), "x") for name in ("epoch", "time", "q", "closed", "number", "folder", "replans", "things")],
        (("epoch",), 10**300),
        (("time",), 1e300),
        (("time",), -1.0),
        (("q",), [0.0, None]),
        (("q",), [0.0, [1.0]]),
        (("closed",), [1]),
        (("number",), 0.5),
        (("number",), -1),
        (("number",), True),
        (("folder",), "../elsewhere"),
        (("folder",), "/etc"),
        (("folder",), "replans/1/../../.."),
        (("things", "box"), None),
        (("things", "box", "hand"), 3),
        (("things", "box", "position"), [0.0, 0.0]),
        (("things", "box", "rotation"), [[0.0] * 3] * 3),
        (("things", "box", "rotation"), [1.0, 0.0, 0.0]),
        (("things", "box", "rotation"), [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
    ],
)
def test_a_checkpoint_that_no_run_writes(tmp_path: Path, path: tuple[str, ...], value: Any) -> None:
    log_of(tmp_path / "run.mcap", "/state", changed(RECORD, *path, value=value))
    with pytest.raises(lgp.LgpError) as error:
        interrupted_run(tmp_path / "run.mcap")
    says(error, tmp_path / "run.mcap", "damaged", "checkpoint", path[-1], "without --resume")


def test_a_number_that_no_computer_has(tmp_path: Path) -> None:
    log_of(tmp_path / "run.mcap", "/state", {**RECORD, "epoch": 10**400})
    with pytest.raises(lgp.LgpError) as error:
        interrupted_run(tmp_path / "run.mcap")
    says(error, tmp_path / "run.mcap", "damaged", "expected finite numbers", "without --resume")


@pytest.mark.parametrize(
    ("name", "value"),
    [("number", "1"), ("time", [0.0]), ("action", 0.5), ("state", "asleep"), ("details", [1]), ("text", None)],
)
def test_an_event_that_no_run_writes(tmp_path: Path, name: str, value: Any) -> None:
    log_of(tmp_path / "run.mcap", "/events", {**EVENT, name: value})
    with pytest.raises(lgp.LgpError) as error:
        interrupted_run(tmp_path / "run.mcap")
    says(error, tmp_path / "run.mcap", "damaged", "event", name, "without --resume")


def test_what_is_written_is_read_again() -> None:
    assert Checkpoint.read(RECORD).record() == RECORD


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_is_one_line_that_says_what_to_do() -> None:
    log = RunLog(Path("/dev/full"), 1.7e9, {})
    log.json("/state", 0.25, RECORD)
    for write in (log.flush, log.close):
        with pytest.raises(lgp.LgpError) as error:
            write()
        says(error, "/dev/full", "No space left", "--resume")
    log.close()
