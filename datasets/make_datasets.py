"""Make the simulated data sets of this folder and their catalogue: `python datasets/make_datasets.py`.

The seed below makes the bytes reproducible. The recorded data set has its own script, `balancing.py`; its section of
the catalogue is written here.
"""

from __future__ import annotations

import argparse
import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import assembly
import balancing
import numpy as np
import palletising
from ros2_bag import Ros2Bag
from ros2_messages import NANOSECONDS, Transform

HERE = Path(__file__).resolve().parent
SEED = 20260101
EPOCH = 1_767_261_600 * NANOSECONDS
"""Arbitrary time stamp of the first frame: 2026-01-01 10:00 UTC."""
COMMAND = "python datasets/make_datasets.py"
LICENCE = "Apache-2.0"
BOX_KG = 9.0


@dataclass(frozen=True)
class Entry:
    """One data set of the catalogue.

    Attributes:
        file: its name.
        shows: content, one sentence.
        frames: number of frames.
        rate: frames per second.
        contents: (topic or column, description with unit).
        source: where the motion comes from.
        made_by: command that reproduces it.
        licence: of the file.
    """

    file: str
    shows: str
    frames: int
    rate: float
    contents: tuple[tuple[str, str], ...]
    source: str = "**simulated**: minimum-jerk movements between key postures; no person was measured"
    made_by: str = ""
    licence: str = LICENCE


RECORDED = Entry(
    file=balancing.FILE,
    shows="A person steps along a low beam with outstretched arms and bends: 1.6 s of a real movement, no work.",
    frames=98,
    rate=balancing.RATE,
    contents=(
        ("format", "TRC, 33 keypoints of MediaPipe Pose, [m], z up"),
        ("not measured", "wrists and shoulder elevation: the keypoints do not show them"),
        (
            "how good",
            "a camera sees a keypoint 9 pixels (median) from where the others see it; joints are 40 mm (median) from "
            "those that Pose2Sim found in the same trial with another pose estimator",
        ),
    ),
    source="**recorded** with four cameras: the demo videos of Pose2Sim (D. Pagnon and others), BSD-3-Clause",
    made_by="`datasets/balancing.py`, which says how",
    licence="BSD-3-Clause, as the videos: see LICENSE.pose2sim; no image of them is here",
)
"""The recording of `balancing.py`."""


def make_palletising(folder: Path) -> Entry:
    """Write the simulated palletising as an MCAP file."""
    motion = palletising.simulate(np.random.default_rng(SEED))
    entry = Entry(
        file="simulated_palletising.mcap",
        shows=(
            f"A person moves {len(palletising.BOXES) - 1} boxes of {BOX_KG:g} kg from a low pallet to a table at waist "
            "height or an overhead shelf: stoop lifts (some twisted), squat lifts, carrying, walking, one pause."
        ),
        frames=len(motion.time),
        rate=palletising.RATE,
        contents=(
            ("format", "MCAP, profile ros2, zstd chunks, CDR with ros2msg schemas"),
            (
                "`/joint_states`",
                "sensor_msgs/msg/JointState: 36 joints of human.urdf (`human_36dof_ISB_model`), position [rad], "
                "velocity [rad/s], no effort",
            ),
            (
                "`/tf`",
                "tf2_msgs/msg/TFMessage: pose of `middle_pelvis` (x forward, y up, z right) in `map` (z up), [m]",
            ),
            ("load", f"{BOX_KG:g} kg while a box is carried; not in the file, give it as `--load {BOX_KG:g}`"),
        ),
    )
    with Ros2Bag(folder / entry.file, library="datasets/make_datasets.py") as bag:
        bag.note(
            "simulated",
            {
                "source": "simulated, no person was measured",
                "made_by": COMMAND,
                "seed": str(SEED),
                "licence": LICENCE,
                "shows": entry.shows,
                "zstandard": version("zstandard"),
            },
        )
        for time, position, velocity, root in zip(
            motion.time, motion.position, motion.velocity, motion.root, strict=True
        ):
            stamp = EPOCH + round(float(time) * NANOSECONDS)
            bag.joints("/joint_states", stamp, palletising.JOINTS, position, velocity)
            bag.transforms("/tf", stamp, [Transform("map", "middle_pelvis", root)])
    return entry


def make_assembly(folder: Path) -> Entry:
    """Write the simulated assembly as a posture table in CSV."""
    time, angles, load = assembly.simulate(np.random.default_rng(SEED + 1))
    entry = Entry(
        file="simulated_assembly.csv",
        shows="A person assembles parts at a bench, fetches them from the side and fixes them above the head.",
        frames=len(time),
        rate=assembly.RATE,
        contents=(
            ("format", "posture table, CSV, one row per frame"),
            ("`time`", "[s]"),
            ("angles", ", ".join(f"`{name}`" for name in assembly.COLUMNS) + " [deg]"),
            ("`load`", "[kg], tool or part in the hands"),
            ("not measured", "the wrists: there are no wrist columns"),
        ),
    )
    rows = [",".join(("time", *assembly.COLUMNS, "load"))]
    rows += [
        ",".join(f"{value:g}" for value in (second, *row, kg))
        for second, row, kg in zip(np.round(time, 3), angles, load, strict=True)
    ]
    (folder / entry.file).write_text("\n".join(rows) + "\n", encoding="utf-8", newline="\n")
    return entry


def describe(data: bytes, entry: Entry, seed: int | None = None) -> str:
    """Section of one data set in the catalogue."""
    lines = [
        f"## {entry.file}",
        "",
        entry.shows,
        "",
        "| | |",
        "|---|---|",
        f"| source | {entry.source} |",
        f"| made by | {entry.made_by or f'`{COMMAND}`, seed {seed}'} |",
        f"| licence | {entry.licence} |",
        f"| frames | {entry.frames} at {entry.rate:g} Hz ({(entry.frames - 1) / entry.rate:.1f} s) |",
        *(f"| {what} | {how} |" for what, how in entry.contents),
        f"| size | {len(data)} bytes |",
        f"| sha256 | `{hashlib.sha256(data).hexdigest()}` |",
        "",
    ]
    return "\n".join(lines)


def make(folder: Path) -> None:
    """Write all data sets and the catalogue README.md into a folder."""
    entries = [make_palletising(folder), make_assembly(folder)]
    sections = [describe((HERE / RECORDED.file).read_bytes(), RECORDED)]
    sections += [
        describe((folder / entry.file).read_bytes(), entry, SEED + number) for number, entry in enumerate(entries)
    ]
    head = (
        "# Data sets\n\n"
        "Small recordings to try the commands on. One is real, from videos; the others are simulated: no person was "
        "measured, and they allow no conclusions about real work.\n"
        f"This page and the simulated files are written by `{COMMAND}` (the same seed gives the same bytes; the bytes "
        "of an MCAP file depend on the version of the zstandard package as well, which its metadata name).\n\n"
    )
    (folder / "README.md").write_text(head + "\n".join(sections), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--folder", type=Path, default=HERE, help="where to write (default: beside the script)")
    make(arguments.parse_args().folder)
