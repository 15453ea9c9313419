"""Scores as ROS messages of their own type, for readers that know no JSON: rosbags, PlotJuggler, `ros2 bag`.

A field for each column of numbers, so that every viewer plots them by name; the definition is in the file. A value that
is missing is NaN, which leaves a gap in a plot; the support is a number, whose names are constants. ROS 2: CDR,
https://design.ros2.org/articles/generated_interfaces_cpp.html and OMG DDS-XTypes 1.3, section 7.4; ROS 1:
https://wiki.ros.org/msg.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reba.arrays import Indices
from reba.posture.factors import SUPPORTS
from reba.writers.json_messages import json_type

SUPPORT: Final = "support"
BLOCK_ROWS: Final = 4096
"""Frames encoded at a time."""
ROS2: Final = "ros2"
ROS1: Final = "ros1"
NAMES: Final = {ROS2: "reba_msgs/msg/Scores", ROS1: "reba_msgs/Scores"}
"""Profile of a file -> name of the type."""
ENCODINGS: Final = {ROS2: ("cdr", "ros2msg"), ROS1: ("ros1", "ros1msg")}
"""Profile -> encoding of messages and of their definitions."""
_LINE: Final = "=" * 80
_STAMP: Final = {ROS2: "builtin_interfaces/Time stamp", ROS1: "uint32 seq\ntime stamp"}
_TIME: Final = f"{_LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"


def definition(data: pd.DataFrame, profile: str) -> str:
    """Return the message definition of the rows of a table, with those that it needs.

    >>> print(definition(pd.DataFrame({"time": [0.0], "reba": [3]}), "ros1").splitlines()[3])
    float64 reba
    """
    columns = _numbers(data).columns
    fields = "".join(f"float64 {name}\n" for name in columns)
    if SUPPORT in columns:
        fields += "".join(f"uint8 {SUPPORT.upper()}_{word.upper()}={code}\n" for code, word in enumerate(SUPPORTS))
    head = "# REBA scores of one frame, time in seconds since the start of the recording; NaN: not known.\n"
    header = f"{_LINE}\nMSG: std_msgs/Header\n{_STAMP[profile]}\nstring frame_id\n"
    return f"{head}std_msgs/Header header\n{fields}{header}{_TIME if profile == ROS2 else ''}"


def _numbers(data: pd.DataFrame) -> pd.DataFrame:
    """Return the columns that are numbers, and the support as its place in `SUPPORTS`; other texts are left out."""
    if SUPPORT in data and json_type(data[SUPPORT]) == "string":
        places = {word: float(code) for code, word in enumerate(SUPPORTS)}
        data = data.assign(**{SUPPORT: data[SUPPORT].map(places)})
    return data[[str(name) for name, column in data.items() if json_type(column) != "string"]]


def ros_rows(data: pd.DataFrame, order: Indices, stamps: NDArray[np.int64], profile: str) -> Iterator[bytes]:
    """Yield the message of rows in an order; `stamps` [ns] are the times in their headers, of all rows."""
    data = _numbers(data)
    # The frame id is empty: its length with the final zero, and that zero, in ROS 2; its length in ROS 1.
    frame = [("length", "<u4")]
    if profile == ROS2:
        head = [("encapsulation", "4u1"), ("sec", "<i4"), ("nanosec", "<u4"), *frame, ("end", "u1"), ("pad", "3u1")]
    else:
        head = [("seq", "<u4"), ("sec", "<u4"), ("nanosec", "<u4"), *frame]
    layout = np.dtype([*head, ("values", "<f8", (len(data.columns),))])
    for first in range(0, len(order), BLOCK_ROWS):
        chosen = order[first : first + BLOCK_ROWS]
        rows = data.iloc[chosen]
        messages = np.zeros(len(rows), layout)
        messages["sec"], messages["nanosec"] = np.divmod(stamps[chosen], 10**9)
        if profile == ROS2:
            messages["encapsulation"], messages["length"] = (0, 1, 0, 0), 1
        else:
            messages["seq"] = chosen
        messages["values"] = rows.astype("Float64").to_numpy(np.float64, na_value=np.nan)
        size = layout.itemsize
        whole = messages.tobytes()
        yield from (whole[at : at + size] for at in range(0, len(whole), size))
