"""Streams over arrays that a reader holds in memory: the end of every whole-file reader."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reba.readers.stream import Block, Kind, ReadLog, Stream

BLOCK = 20_000
"""Samples handed out at once: a few tens of MB for a whole body."""

Values = Callable[[slice], NDArray[np.float64]]


def array_stream(
    name: str,
    kind: Kind,
    format: str,
    names: Sequence[str],
    time: NDArray[np.float64],
    values: NDArray[np.float64] | Values,
    *,
    opened: ReadLog,
    **more: Any,
) -> Stream:
    """Return a stream that hands out `values` in blocks of `BLOCK` samples.

    Args:
        name, kind, format, names: as in `Stream`; k names.
        time: (n,) [s].
        values: (n, k) or (n, k, 3) or (n, k, 7) as in `Block`, or a function of a slice of samples that gives them.
        opened: what was noticed while the file was opened; every reading starts with it.
        more: further fields of `Stream`.
    """
    given = tuple(names)
    parents: tuple[str, ...] = more.get("parents", ())

    def read(log: ReadLog, wanted: Sequence[str] | None) -> Iterator[Block]:
        keep = list(range(len(given)))
        if wanted is not None:
            chosen = set(wanted)
            keep = [index for index, known in enumerate(given) if known in chosen]
        log.messages += len(time) + opened.skipped
        log.skip(opened.skipped, opened.first_skipped or "")
        log.ended_abnormally = log.ended_abnormally or opened.ended_abnormally
        log.time_source = opened.time_source
        for warning in opened.warnings:
            log.warn(warning)
        for start in range(0, len(time), BLOCK):
            part = slice(start, start + BLOCK)
            all_values = values(part) if callable(values) else values[part]
            yield Block(
                time[part],
                tuple(given[index] for index in keep),
                all_values if wanted is None else all_values[:, keep],
                tuple(parents[index] for index in keep) if parents else (),
            )

    return Stream(name, kind, format, given, read, count=len(time), **more)


def unique_names(names: Sequence[str], log: ReadLog) -> tuple[str, ...]:
    """Return the names with `_2`, `_3` ... behind those that come again, and note it.

    >>> unique_names(["hip", "knee", "hip"], ReadLog())
    ('hip', 'knee', 'hip_2')
    """
    taken = set(names)
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique = name
        if seen[name] > 1:
            while unique in taken:
                unique = f"{name}_{seen[name]}"
                seen[name] += unique in taken
            taken.add(unique)
            log.warn(f"the name {clip(name)} stands more than once; the later one is called {clip(unique)}")
        result.append(unique)
    return tuple(result)


def clip(text: str, length: int = 40) -> str:
    """Return the text quoted on one line and shortened, fit for a message.

    >>> clip("a" * 50, 8)
    "'aaaaaaaa...'"
    """
    return repr(text if len(text) <= length else text[:length] + "...")


def check_time(time: NDArray[np.float64], log: ReadLog) -> None:
    """Note it when time stands still or runs backwards."""
    steps = np.diff(time)
    if np.any(steps < 0):
        log.warn(f"time runs backwards {int(np.sum(steps < 0))} times, first after {time[np.argmax(steps < 0)]:.6g} s")
    elif np.any(steps == 0):
        log.warn(f"{int(np.sum(steps == 0))} samples have the time of the one before")
