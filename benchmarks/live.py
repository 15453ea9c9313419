"""Latency of `reba live`, from the bytes of a frame to its line, and its throughput.

    python benchmarks/live.py [--seconds 20] [--rate 100] [--budget 10] [--json FILE]

The command runs in its own process. Paced: frames are written at the rate, and the arrival of each line is timed (the
pipe and the wake-up of the reader included). At once: all frames exist already; the throughput is measured between the
first and the last line. Frames that are delayed by the decision on signs and units (settling), and those of the
following two seconds, are left out of the latencies; the largest latency of these is listed separately.
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
"""Byte offset of the first time stamp in a CDR message."""
SETTLE = 2.0
"""Delay of the first frames by default [s]."""
CATCH_UP = 2.0
"""Time after it in which the delay decreases [s]."""

Put = Callable[[int], None]


def messages() -> dict[str, list[tuple[str, bytes, bytes]]]:
    """Topic -> (schema name, schema, payload) of every message of the data set."""
    by_topic: dict[str, list[tuple[str, bytes, bytes]]] = {}
    with DATA.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            by_topic.setdefault(channel.topic, []).append((schema.name, schema.data, message.data))
    return by_topic


def file_writer(path: Path, rate: float) -> Put:
    """Function that appends frame k to an MCAP file without chunks: the pelvis on /tf, then the joints."""
    recorded = messages()
    stream = path.open("wb")
    writer = Writer(stream, use_chunking=False)
    writer.start(profile="ros2", library="benchmarks/live.py")
    channels = {}
    for topic in ("/tf", "/joint_states"):
        name, text, _ = recorded[topic][0]
        channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", text))

    def put(number: int) -> None:
        moment = EPOCH + round(number / rate * 1e9)
        for topic, channel in channels.items():
            name, _, payload = recorded[topic][number % len(recorded[topic])]
            data = bytearray(payload)
            struct.pack_into("<iI", data, STAMP_AT[name], *divmod(moment, 10**9))
            writer.add_message(channel, moment, bytes(data), moment)
        stream.flush()

    stream.flush()
    return put


def line_texts(kind: str, rate: float, count: int) -> list[bytes]:
    """Frames as JSON lines: rows of the posture table, or joint states."""
    if kind == "rows":
        table = reba.read(DATA).data
        rows = [json.dumps(row)[1:] for row in table.drop(columns="time").to_dict(orient="records")]
    else:
        rows = [json.dumps(row)[1:] for row in _joint_states()]
    return [f'{{"time": {k / rate:.4f}, {rows[k % len(rows)]}\n'.encode() for k in range(count)]


def line_writer(pipe: IO[bytes] | None, texts: list[bytes]) -> Put:
    """Function that writes line k into a pipe."""

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
    """Thread that records the arrival time of each line, and the last line."""

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
        """Latency [ms] of each frame after the delayed ones; the last line is the summary."""
        arrived = np.array(self.times[: len(written)])
        return 1000 * (arrived - np.array(written))[held:]


def paced(kind: str, rate: float, seconds: float) -> tuple[np.ndarray, dict[str, object]]:
    """Latency of every frame [ms], and the summary."""
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
        # The start of Python is not part of the latency of a frame.
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
    """Throughput [frames/s]."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "live"
        if kind == "mcap":
            put = file_writer(path, rate)
            for number in range(count):
                put(number)
            command, source = [*COMMAND, str(path), "--until-idle", "0"], subprocess.DEVNULL
        else:
            path.write_bytes(b"".join(line_texts(kind, rate, count)))
            command, source = [*COMMAND, "-"], path.open("rb")  # type: ignore[assignment]
        with subprocess.Popen(command, stdin=source, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as running:
            assert running.stdout is not None
            arrivals = Arrivals(running.stdout)
            arrivals.start()
            arrivals.join()
    return (count - 1) / (arrivals.times[count - 1] - arrivals.times[0])


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="length of the paced run")
    parser.add_argument("--rate", type=float, default=100.0, help="frames a second")
    parser.add_argument("--budget", type=float, default=10.0, help="milliseconds a frame may take")
    parser.add_argument("--frames", type=int, default=20_000, help="frames of the run at once")
    parser.add_argument("--kinds", nargs="+", default=["mcap", "rows", "joints"], choices=["mcap", "rows", "joints"])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    rows = []
    print(stamp())
    print(f"{options.rate:g} frames a second for {options.seconds:g} s; budget {options.budget:g} ms a frame\n")
    print(f"{'source':<8}{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}{'in budget':>11}{'settling ms':>13}{'inside p50':>12}"
          f"{'frames/s at once':>18}")  # fmt: skip
    for kind in options.kinds:
        times, summary = paced(kind, options.rate, options.seconds)
        fast = at_once(kind, options.rate, options.frames)
        settling, times = np.split(times, [round(options.rate * CATCH_UP)])
        middle, late = np.percentile(times, [50, 99])
        inside = summary["latency"]
        share = float(np.mean(times <= options.budget))
        assert isinstance(inside, dict)
        print(f"{kind:<8}{middle:>9.2f}{late:>9.2f}{times.max():>9.2f}{share:>11.1%}{settling.max():>13.0f}"
              f"{inside['p50_ms']:>12.2f}{fast:>18,.0f}", flush=True)  # fmt: skip
        row = {"source": kind, "p50_ms": middle, "p99_ms": late, "most_ms": times.max(), "in_budget": share}
        rows.append({key: value if key == "source" else float(value) for key, value in row.items()} | {"at_once": fast})
    if options.json:
        written = {"machine": machine(), "rate": options.rate, "budget_ms": options.budget, "rows": rows}
        options.json.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
