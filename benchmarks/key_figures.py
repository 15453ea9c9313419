"""The key figures of each benchmark: which numbers of its JSON stand in the one table, and against what they are held.

`SCRIPTS` holds for every script the words that make it quick and the function that takes its figures out of its JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np


class Figure(NamedTuple):
    """One row: what was measured, its value with unit, what it is held against, our value over or under that."""

    what: str
    value: str
    against: str = ""
    ratio: float | None = None


@dataclass(frozen=True)
class Script:
    """One benchmark.

    Attributes:
        name: of the script.
        figures: yields the key figures of its JSON.
        quick: words that make it take some seconds.
        needs: why it is left out of a run of all, if it is.
    """

    name: str
    figures: Callable[[dict[str, Any]], Iterator[Figure]]
    quick: tuple[str, ...] = ()
    needs: str = ""


def correctness(found: dict[str, Any]) -> Iterator[Figure]:
    row = next(row for row in found["rows"] if row["score"] == "reba")
    postures = f"{found['postures']:,} random postures"
    yield Figure("scores in which ergonomics-metrics differs", f"{row['share']:.1%}", postures, row["share"])


def scoring(found: dict[str, Any]) -> Iterator[Figure]:
    for row in found["rows"][1:]:
        speed = f"{row['frames_per_second']:,.0f} frames/s"
        yield Figure(row["what"], speed, "time of numpy.sum over the angles", row["times_sum"])
    if found["ratio"] is not None:
        yield Figure("score_array beside ergonomics-metrics", "", "its speed, both arms", found["ratio"])


def reading(found: dict[str, Any]) -> Iterator[Figure]:
    for name, row in found["recordings"].items():
        speed = f"{row['ours_messages_per_s']:,.0f} messages/s"
        yield Figure(f"{name} of MCAP", speed, "speed of mcap + mcap-ros2-support", row["speed_up"])
        yield Figure(f"{name} of MCAP", f"{row['ours_s']:.3f} s", "time of unpacking zstd alone", row["ours_over_zstd"])


def whole_command(found: dict[str, Any]) -> Iterator[Figure]:
    row = found["rows"][-1]
    what = f"reba score of {row['minutes']:g} min at 100 Hz"
    yield Figure(what, f"{row['seconds']:.2f} s", "real time", row["minutes"] * 60 / row["seconds"])
    yield Figure(what, f"{row['peak_mb']:.0f} MB at most", "size of the file", row["peak_mb"] / row["file_mb"])


def quadratic(found: dict[str, Any]) -> Iterator[Figure]:
    from dreba.surrogates.metrics import PUBLISHED_OVERALL

    for row in found["errors"]:
        rmse = row["overall"]["rmse"]
        yield Figure(
            f"RMSE, {row['domain']}: {row['form']}", f"{rmse:.2f}", "Table I of the paper", rmse / PUBLISHED_OVERALL
        )
    yield Figure("draw and fit again", f"{found['refit_s']:.2f} s")


def soft(found: dict[str, Any]) -> Iterator[Figure]:
    from dreba.surrogates.metrics import PUBLISHED_OVERALL

    for row in found["rows"]:
        what = f"RMSE of soft tables at {row['temperature']:g} deg"
        yield Figure(what, f"{row['rmse']:.3f}", "Table I of the paper", row["rmse"] / PUBLISHED_OVERALL)


def surrogate_speed(found: dict[str, Any]) -> Iterator[Figure]:
    net = found["rows"][-1]
    for row in found["rows"]:
        times = row["batch_per_second"] / net["batch_per_second"]
        yield Figure(
            f"{row['kind']}, value and gradient",
            f"{row['batch_per_second']:,.0f} poses/s",
            f"speed of {net['kind']}",
            times,
        )


def enabler(found: dict[str, Any]) -> Iterator[Figure]:
    for row in found["rows"]:
        what = f"true REBA of optima, {row['method']}, {row['starts']} starts"
        yield Figure(what, f"{row['mean']:.2f}", "best known", row["mean"] / row["best_known"])


def sqp(found: dict[str, Any]) -> Iterator[Figure]:
    solved = [row for row in found["rows"] if row["case"] in ("from rest", "warm, places 1 cm away", "warm, PIQP")]
    for row in solved:
        own = next(r for r in solved if (r["slices"], r["case"]) == (row["slices"], "warm, places 1 cm away"))
        yield Figure(
            f"path of {row['slices']} slices, {row['case']}",
            f"{row['ms']:.1f} ms",
            "our warm solve",
            row["ms"] / own["ms"],
        )
    for case in ("from rest", "warm, places 1 cm away"):
        yield from _growth(case, [row for row in solved if row["case"] == case], "slices")


def reachability(found: dict[str, Any]) -> Iterator[Figure]:
    yield Figure("map of reach", f"{found['seconds']:.2f} s")


def bounds(found: dict[str, Any]) -> Iterator[Figure]:
    for cost, row in found["figures"].items():
        nodes = row["nodes"]
        yield Figure(
            f"nodes searched, {cost}",
            f"{nodes['search']:,}",
            "all nodes",
            nodes["search"] / max(nodes["everything"], 1),
        )
        for level in ("pose", "sequence"):
            low = row[f"{level} / path"]
            wrong = f"above the path's cost in {low['above']} of {low['n']}"
            yield Figure(f"bound of the {level} problem, {cost}", wrong, "cost of the path, median", low["median"])
    yield Figure("goal out of reach is refused", f"{found['refused']['milliseconds']:.1f} ms")


def cost_models(found: dict[str, Any]) -> Iterator[Figure]:
    plain = found["results"]["no ergonomics"]["figures"]
    for name, result in found["results"].items():
        row = result["figures"]
        value = f"REBA {row['reba_mean']:.2f}, {row['seconds']:.2f} s"
        yield Figure(f"plans with cost {name}", value, "REBA without ergonomics", row["reba_mean"] / plain["reba_mean"])


def path(found: dict[str, Any]) -> Iterator[Figure]:
    own = found["same"][0]
    for row in found["same"]:
        for words, key in (("fastest", "ms"), ("median", "median_ms")):
            value = f"{row[key]:.1f} ms"
            yield Figure(f"the same path, {row['case']}, {words}", value, "our time", row[key] / own[key])
    for row in found["plain"]:
        value = f"{row['ms']:.1f} ms"
        yield Figure(f"shipped cost, {row['case']}", value, "without collisions", row["ms"] / found["plain"][0]["ms"])
    for word in ("slices", "objects"):
        rows = [{**row, word: int(row["case"].split()[0])} for row in found["growth"] if row["case"].endswith(word)]
        yield from _growth("path, set up and solved", rows, word)


def study_nulls(found: dict[str, Any]) -> Iterator[Figure]:
    for conditions, tests in found["null"].items():
        for name, row in tests.items():
            value = f"{row['rate']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
            yield Figure(f"false alarms, {conditions} conditions, {name}", value, "5 %", row["rate"] / 0.05)


def toolbox(found: dict[str, Any]) -> Iterator[Figure]:
    for row in found["rows"]:
        value = f"{row['cpu_seconds']:.1f} s, {row['actions']} actions, {row['status']}"
        yield Figure(f"toolbox of {row['parts']} parts, {row['what']}", value)


def scale(found: dict[str, Any]) -> Iterator[Figure]:
    rows = found["rows"]
    for row in rows:
        most = max(row["parent_mb"], row["worker_mb"])
        value = f"{row['frames_per_second_and_job']:,.0f} frames/s and core, {most:.0f} MB a process"
        against, ratio = "one process", row["recordings_per_second"] / rows[0]["recordings_per_second"]
        if "Dask" in row["run"]:
            against, ratio = "time of local processes", row["seconds"] / rows[1]["seconds"]
        yield Figure(f"{row['recordings']} recordings, {row['run']}", value, against, ratio)


def live(found: dict[str, Any]) -> Iterator[Figure]:
    for row in found["rows"]:
        against, ratio = f"{found['budget_ms']:g} ms a frame", row["p99_ms"] / found["budget_ms"]
        value = f"p50 {row['p50_ms']:.1f} ms, p99 {row['p99_ms']:.1f} ms"
        yield Figure(f"live, {row['source']} at {found['rate']:g} frames/s", value, against, ratio)
        yield Figure(f"live, {row['source']} all at once", f"{row['at_once']:,.0f} frames/s")


def nothing(found: dict[str, Any]) -> Iterator[Figure]:
    yield from ()


def _growth(what: str, rows: list[dict[str, Any]], by: str) -> Iterator[Figure]:
    """Yield the exponent with which time grows."""
    if len({row[by] for row in rows}) > 1:
        power = np.polyfit(np.log([row[by] for row in rows]), np.log([row["ms"] for row in rows]), 1)[0]
        sizes = f"{min(row[by] for row in rows)} to {max(row[by] for row in rows)} {by}"
        yield Figure(f"growth, {what}", f"time ~ {by}^{power:.2f}", sizes)


SCRIPTS: tuple[Script, ...] = (
    Script("correctness", correctness, ("--postures", "1000")),
    Script("scoring", scoring, ("--frames", "100000", "--repeat", "2")),
    Script("reading", reading, ("--messages", "6000", "--repeat", "2")),
    Script("whole_command", whole_command, ("--minutes", "1")),
    Script("quadratic", quadratic, ("--poses", "2000", "--repeat", "2")),
    Script("soft", soft, ("--poses", "5000")),
    Script("surrogate_speed", surrogate_speed),
    Script("enabler", enabler, ("--tasks", "1", "--net-poses", "1000")),
    Script("sqp", sqp, ("--slices", "20", "--repeat", "1")),
    Script("reachability", reachability),
    Script("bounds", bounds, ("--runs", "1")),
    Script("cost_models", cost_models, ("--runs", "1", "--models", "convex")),
    Script("path", path, ("--repeat", "1", "--no-growth")),
    Script("toolbox", toolbox, ("--parts", "2", "--seconds", "5")),
    Script("study_nulls", study_nulls, ("--studies", "20", "--files", "0")),
    Script("scale", scale, ("--recordings", "4", "--minutes", "1", "--subset", "2", "--mcap", "1")),
    Script("live", live, ("--seconds", "4", "--frames", "1000", "--kinds", "rows")),
    Script("one_camera", nothing, needs="a folder of one-camera recordings; python benchmarks/one_camera.py FOLDER"),
)
"""All, in the order of the table."""
