"""Sources for `reba live`: recordings rewritten message by message, files that grow, what came out."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from scipy.spatial.transform import Rotation

import reba
from reba.method.scoring import SCORE_COLUMNS
from tests.support.body_motion import PARENTS, BodyMotion
from tests.support.paths import ROOT

PALLETISING = ROOT / "datasets" / "simulated_palletising.mcap"
COMMAND = str(Path(sys.executable).parent / "reba")


def rewritten(path: Path, start: float, stop: float, *, chunked: bool, source: Path = PALLETISING) -> Path:
    """Write the messages of a recording between two times [s], in small chunks or without any."""
    with source.open("rb") as stream, path.open("wb") as out:
        writer = Writer(out, chunk_size=20_000, compression=CompressionType.ZSTD, use_chunking=chunked)
        writer.start(profile="ros2", library="tests")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        first = None
        for schema, channel, message in make_reader(stream).iter_messages():
            first = message.log_time if first is None else first
            if not start <= (message.log_time - first) / 1e9 < stop:
                continue
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id]
                )
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def moving_body(count: int) -> BodyMotion:
    """Return a made-up person at 50 Hz whose every segment sways."""
    names = ("pelvis", *PARENTS)
    height = {"pelvis": 1.0, "head": 1.6, "foot": 0.1, "toe": 0.05, "upper_leg": 0.9, "lower_leg": 0.5}
    random_state = np.random.default_rng(3)
    seconds = np.arange(count) / 50.0
    rotation = np.empty((count, len(names), 3, 3))
    position = np.zeros((count, len(names), 3))
    for at, name in enumerate(names):
        side, _, part = name.partition("_") if "_" in name else ("", "", name)
        phase, rate = random_state.uniform(0, 6, 3), random_state.uniform(0.5, 2.0, 3)
        rotation[:, at] = Rotation.from_euler("xyz", 0.5 * np.sin(seconds[:, None] * rate + phase)).as_matrix()
        position[:, at] = [
            0.15 if part == "toe" else 0.0, {"left": 0.2, "right": -0.2}.get(side, 0.0), height.get(part, 1.4)
        ]  # fmt: skip
        position[:, at, 0] += 0.05 * np.sin(seconds * rate[0])
    return BodyMotion(seconds, names, rotation, position)


class GrowingFile(threading.Thread):
    """Appends bytes to a file in slices of random length, which end anywhere in a record.

    Args:
        path: file to append to.
        data: what is written.
        pause: [s] between two slices.
        slices: number of them.
    """

    def __init__(self, path: Path, data: bytes, slices: int = 60, pause: float = 0.01) -> None:
        super().__init__(daemon=True)
        cuts = sorted(random.Random(5).sample(range(1, len(data)), slices - 1))
        self._parts = [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]
        self._path, self._pause = path, pause

    def run(self) -> None:
        """Write slice after slice."""
        for part in self._parts:
            with self._path.open("ab") as file:
                file.write(part)
            time.sleep(self._pause)


def run_live(*arguments: str, stdin: str | None = None) -> tuple[int, list[dict[str, Any]], str]:
    """Run the command; return its exit code, its lines and what it said."""
    done = subprocess.run(
        [COMMAND, "live", *arguments], input=stdin or "", capture_output=True, text=True, check=False, timeout=120
    )
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines()], done.stderr


def batch(path: Path, neutral: str = "none", **options: Any) -> pd.DataFrame:
    """Return the score table of `reba score --activity none`."""
    return reba.score(reba.read(path, neutral=neutral), activity="none", **options).data


def assert_same(lines: Sequence[dict[str, Any]], table: pd.DataFrame) -> None:
    """Compare every score of every frame, and the times."""
    assert len(lines) == len(table)
    assert [line["time"] for line in lines] == table["time"].tolist()
    for name in SCORE_COLUMNS:
        expected = [None if value is pd.NA else int(value) for value in table[name]]
        assert [line[name] for line in lines] == expected, name


def json_lines(rows: Iterable[dict[str, Any]]) -> str:
    """Return rows as text, one JSON object a line."""
    return "".join(json.dumps(row) + "\n" for row in rows)
