"""How long `reba live` takes from the bytes of a frame being there to its line being there, and how much it can take.

    python benchmarks/live.py [--seconds 20] [--rate 100] [--budget 10] [--json FILE]

The command runs as a process of its own. Paced: frames are written one by one at the rate, and each line is timed where
it arrives (the pipe and the wake-up of the reader count). At once: everything is there already; frames a second are
counted between the first and the last line. Frames that settling holds back, and those of the two seconds after it that
catch up with what the decision took, are left out of the times; how late the latest of these came stands apart.
"""

from __future__ import annotations

import argparse
import json
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

import numpy as np
from machine import machine, stamp
from mcap.reader import make_reader
from mcap.writer import Writer

import reba

DATA = Path(__file__).resolve().parents[1] / "datasets" / "simulated_palletising.mcap"
COMMAND = [str(Path(sys.executable).parent / "reba"), "live"]
EPOCH = 1_700_000_000 * 10**9
STAMP_AT = {"sensor_msgs/msg/JointState": 4, "tf2_msgs/msg/TFMessage": 8}
"""Where the first time stamp stands in a message in CDR."""
SETTLE = 2.0
"""[s] Held back by default."""
CATCH_UP = 2.0
"""[s] After it."""

Put = Callable[[int], None]


def messages() -> dict[str, list[tuple[str, bytes, bytes]]]:
    """Return topic -> (schema name, schema, payload) of every message of the data set."""
    found: dict[str, list[tuple[str, bytes, bytes]]] = {}
    with DATA.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append((schema.name, schema.data, message.data))
    return found


def file_writer(path: Path, rate: float) -> Put:
    """Return what appends frame k to an MCAP file without chunks: the pelvis on /tf, then the joints."""
    given = messages()
    stream = path.open("wb")
    writer = Writer(stream, use_chunking=False)
    writer.start(profile="ros2", library="benchmarks/live.py")
    channels = {}
    for topic in ("/tf", "/joint_states"):
        name, text, _ = given[topic][0]
        channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", text))

    def put(number: int) -> None:
        moment = EPOCH + round(number / rate * 1e9)
        for topic, channel in channels.items():
            name, _, payload = given[topic][number % len(given[topic])]
            data = bytearray(payload)
            struct.pack_into("<iI", data, STAMP_AT[name], *divmod(moment, 10**9))
            writer.add_message(channel, moment, bytes(data), moment)
        stream.flush()

    stream.flush()
    return put


def line_texts(kind: str, rate: float, count: int) -> list[bytes]:
    """Return frames as JSON lines: rows of the posture table, or joint states."""
    if kind == "rows":
        table = reba.read(DATA).data
        rows = [json.dumps(row)[1:] for row in table.drop(columns="time").to_dict(orient="records")]
    else:
        rows = [json.dumps(row)[1:] for row in _joint_states()]
    return [f'{{"time": {k / rate:.4f}, {rows[k % len(rows)]}\n'.encode() for k in range(count)]


def line_writer(pipe: IO[bytes] | None, texts: list[bytes]) -> Put:
    """Return what writes line k into a pipe."""

    def put(number: int) -> None:
        if pipe is not None:
            pipe.write(texts[number])

    return put


def _joint_states() -> Iterator[dict[str, object]]:
    from mcap_ros2.decoder import DecoderFactory

    with DATA.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for *_, message in reader.iter_decoded_messages(topics=["/joint_states"]):
            yield {"name": list(message.name), "position": list(message.position)}


class Arrivals(threading.Thread):
    """Notes when each line arrives, and keeps the last."""

    def __init__(self, stream: IO[bytes]) -> None:
        super().__init__(daemon=True)
        self.times: list[float] = []
        self.last = b""
        self._stream = stream

    def run(self) -> None:
        """Read until the end."""
        for line in self._stream:
            self.times.append(time.perf_counter())
            self.last = line

    def latencies(self, written: list[float], held: int) -> np.ndarray:
        """Return [ms] of each frame after those held back; the last line is the summary."""
        arrived = np.array(self.times[: len(written)])
        return 1000 * (arrived - np.array(written))[held:]


def paced(kind: str, rate: float, seconds: float) -> tuple[np.ndarray, dict[str, object]]:
    """Return the latency of every frame [ms], and the summary."""
    count = round(rate * seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "live.mcap"
        put: Put
        if kind == "mcap":
            put = file_writer(path, rate)
            running = subprocess.Popen(
                [*COMMAND, str(path), "--until-idle", "3"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        else:
            texts = line_texts(kind, rate, count)
            running = subprocess.Popen(
                [*COMMAND, "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0
            )
            put = line_writer(running.stdin, texts)
        assert running.stdout is not None
        arrivals = Arrivals(running.stdout)
        arrivals.start()
        # Starting Python is no latency of a frame.
        time.sleep(3.0)
        written = []
        start = time.perf_counter()
        for number in range(count):
            time.sleep(max(start + number / rate - time.perf_counter(), 0.0))
            written.append(time.perf_counter())
            put(number)
        if running.stdin is not None:
            running.stdin.close()
        running.wait()
        arrivals.join()
    held = round(rate * (SETTLE + 0.05)) if kind != "rows" else 0
    return arrivals.latencies(written, held), json.loads(arrivals.last)["summary"]


def at_once(kind: str, rate: float, count: int) -> float:
    """Return frames per second."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "live"
        if kind == "mcap":
            put = file_writer(path, rate)
            for number in range(count):
                put(number)
            command, given = [*COMMAND, str(path), "--until-idle", "0"], subprocess.DEVNULL
        else:
            path.write_bytes(b"".join(line_texts(kind, rate, count)))
            command, given = [*COMMAND, "-"], path.open("rb")  # type: ignore[assignment]
        with subprocess.Popen(command, stdin=given, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as running:
            assert running.stdout is not None
            arrivals = Arrivals(running.stdout)
            arrivals.start()
            arrivals.join()
    return (count - 1) / (arrivals.times[count - 1] - arrivals.times[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="length of the paced run")
    parser.add_argument("--rate", type=float, default=100.0, help="frames a second")
    parser.add_argument("--budget", type=float, default=10.0, help="milliseconds a frame may take")
    parser.add_argument("--frames", type=int, default=20_000, help="frames of the run at once")
    parser.add_argument("--kinds", nargs="+", default=["mcap", "rows", "joints"], choices=["mcap", "rows", "joints"])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    chosen = parser.parse_args()
    rows = []
    print(stamp())
    print(f"{chosen.rate:g} frames a second for {chosen.seconds:g} s; budget {chosen.budget:g} ms a frame\n")
    print(f"{'source':<8}{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}{'in budget':>11}{'settling ms':>13}{'inside p50':>12}"
          f"{'frames/s at once':>18}")  # fmt: skip
    for kind in chosen.kinds:
        times, summary = paced(kind, chosen.rate, chosen.seconds)
        fast = at_once(kind, chosen.rate, chosen.frames)
        settling, times = np.split(times, [round(chosen.rate * CATCH_UP)])
        middle, late = np.percentile(times, [50, 99])
        inside = summary["latency"]
        share = float(np.mean(times <= chosen.budget))
        assert isinstance(inside, dict)
        print(f"{kind:<8}{middle:>9.2f}{late:>9.2f}{times.max():>9.2f}{share:>11.1%}{settling.max():>13.0f}"
              f"{inside['p50_ms']:>12.2f}{fast:>18,.0f}", flush=True)  # fmt: skip
        row = {"source": kind, "p50_ms": middle, "p99_ms": late, "most_ms": times.max(), "in_budget": share}
        rows.append({key: value if key == "source" else float(value) for key, value in row.items()} | {"at_once": fast})
    if chosen.json:
        written = {"machine": machine(), "rate": chosen.rate, "budget_ms": chosen.budget, "rows": rows}
        chosen.json.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
