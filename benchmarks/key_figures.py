"""Key figures of each benchmark: the numbers of its JSON in the common table, and their references.

`SCRIPTS` holds for every script its arguments for a quick run and the function that reads the key figures from its
JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


class Figure(NamedTuple):
    """One row: the quantity, its value with unit, the reference, and the ratio of value to reference."""

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
        quick: arguments for a run of some seconds.
        needs: why it is not part of a run of all scripts, else "".
    """

    name: str
    figures: Callable[[dict[str, Any]], Iterator[Figure]]
    quick: tuple[str, ...] = ()
    needs: str = ""


def correctness(data: dict[str, Any]) -> Iterator[Figure]:
    row = next(row for row in data["rows"] if row["score"] == "reba")
    postures = f"{data['postures']:,} random postures"
    yield Figure("scores in which ergonomics-metrics differs", f"{row['share']:.1%}", postures, row["share"])


def random_start(data: dict[str, Any]) -> Iterator[Figure]:
    for variant, one in data["variants"].items():
        for factor, shares in one["shares"].items():
            what = f"{variant}, random posture, the person's accelerations times {float(factor):g}: left table"
            yield Figure(what, f"{shares['left']:.0f} %", "the paper, 66 %", shares["left"] / 66.0)


def scoring(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"][1:]:
        speed = f"{row['frames_per_second']:,.0f} frames/s"
        yield Figure(row["what"], speed, "time of numpy.sum over the angles", row["times_sum"])
    if data["ratio"] is not None:
        yield Figure("score_array beside ergonomics-metrics", "", "its speed, both arms", data["ratio"])


def distribution(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"][1:]:
        speed = f"{row['frames_per_second']:,.0f} frames/s"
        yield Figure(row["what"], speed, "time of the scores alone", row["times_scores"])


def reading(data: dict[str, Any]) -> Iterator[Figure]:
    for name, row in data["recordings"].items():
        speed = f"{row['ours_messages_per_s']:,.0f} messages/s"
        yield Figure(f"{name} of MCAP", speed, "speed of mcap + mcap-ros2-support", row["speed_up"])
        yield Figure(f"{name} of MCAP", f"{row['ours_s']:.3f} s", "time of unpacking zstd alone", row["ours_over_zstd"])


def whole_command(data: dict[str, Any]) -> Iterator[Figure]:
    row = data["rows"][-1]
    what = f"reba score of {row['minutes']:g} min at 100 Hz"
    yield Figure(what, f"{row['seconds']:.2f} s", "real time", row["minutes"] * 60 / row["seconds"])
    yield Figure(what, f"{row['peak_mb']:.0f} MB at most", "size of the file", row["peak_mb"] / row["file_mb"])


def quadratic(data: dict[str, Any]) -> Iterator[Figure]:
    from dreba.surrogates.metrics import PUBLISHED_OVERALL

    for row in data["errors"]:
        rmse = row["overall"]["rmse"]
        yield Figure(
            f"RMSE, {row['domain']}: {row['form']}", f"{rmse:.2f}", "Table I of the paper", rmse / PUBLISHED_OVERALL
        )
    yield Figure("draw and fit again", f"{data['refit_s']:.2f} s")


def soft(data: dict[str, Any]) -> Iterator[Figure]:
    from dreba.surrogates.metrics import PUBLISHED_OVERALL

    for row in data["rows"]:
        what = f"RMSE of soft tables at {row['temperature']:g} deg"
        yield Figure(what, f"{row['rmse']:.3f}", "Table I of the paper", row["rmse"] / PUBLISHED_OVERALL)


def surrogate_speed(data: dict[str, Any]) -> Iterator[Figure]:
    net = data["rows"][-1]
    for row in data["rows"]:
        times = row["batch_per_second"] / net["batch_per_second"]
        yield Figure(
            f"{row['kind']}, value and gradient",
            f"{row['batch_per_second']:,.0f} poses/s",
            f"speed of {net['kind']}",
            times,
        )


def enabler(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"]:
        what = f"true REBA of optima, {row['set']}, {row['start']} starts, {row['name']}"
        yield Figure(what, f"{row['reba']:.2f}", "proved minimum", row["reba"] / row["certified"])


def sqp(data: dict[str, Any]) -> Iterator[Figure]:
    solved = [row for row in data["rows"] if row["case"] in ("from rest", "warm, places 1 cm away", "warm, PIQP")]
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


def reachability(data: dict[str, Any]) -> Iterator[Figure]:
    yield Figure("map of reach", f"{data['seconds']:.2f} s")


def bounds(data: dict[str, Any]) -> Iterator[Figure]:
    for cost, row in data["figures"].items():
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
    yield Figure("goal out of reach is refused", f"{data['refused']['milliseconds']:.1f} ms")


def cost_models(data: dict[str, Any]) -> Iterator[Figure]:
    plain = data["results"]["no ergonomics"]["figures"]
    for name, result in data["results"].items():
        row = result["figures"]
        value = f"REBA {row['reba_mean']:.2f}, {row['seconds']:.2f} s"
        yield Figure(f"plans with cost {name}", value, "REBA without ergonomics", row["reba_mean"] / plain["reba_mean"])


def poses(data: dict[str, Any]) -> Iterator[Figure]:
    for who in dict.fromkeys(row["pose"] for row in data["rows"]):
        *batches, alone = (row for row in data["rows"] if row["pose"] == who)
        for row in batches:
            each = row["each_ms"]
            what = f"iteration of a pose of {who}, {row['starts']} at once"
            yield Figure(what, f"{each:.2f} ms", "time alone", each / alone["each_ms"])


def starts(data: dict[str, Any]) -> Iterator[Figure]:
    for kind, rows in data["rows"].items():
        for name in ("found", "alone"):
            good = sum(row[name] <= 1.01 * row["known"] for row in rows)
            yield Figure(f"best known path of a sequence, {kind}, {name}", f"{good} of {len(rows)} within 1 %")


def optima(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"]:
        value = f"{row['ours']:.5f}"
        yield Figure(f"cost of a path, {row['cost']}", value, "cost by IPOPT", row["ours"] / row["ipopt"])


def path(data: dict[str, Any]) -> Iterator[Figure]:
    own = data["same"][0]
    for row in data["same"]:
        for words, key in (("fastest", "ms"), ("median", "median_ms")):
            value = f"{row[key]:.1f} ms"
            yield Figure(f"the same path, {row['case']}, {words}", value, "our time", row[key] / own[key])
    for row in data["plain"]:
        value = f"{row['ms']:.1f} ms"
        yield Figure(f"shipped cost, {row['case']}", value, "without collisions", row["ms"] / data["plain"][0]["ms"])
    for word in ("slices", "objects"):
        rows = [{**row, word: int(row["case"].split()[0])} for row in data["growth"] if row["case"].endswith(word)]
        yield from _growth("path, set up and solved", rows, word)


def plan_time(data: dict[str, Any]) -> Iterator[Figure]:
    targets = {"iteration, path": ("3 ms", 3.0), "iteration, collision rows": ("5 ms", 5.0)}
    for row in data["rows"]:
        what = f"plan of {row['scene']}, {row['version']}"
        yield Figure(what, f"{row['plan']:.2f} s, cost {row['cost']:.3f}", "1 s", row["plan"])
        for key, (target, least) in targets.items():
            seconds, count = row["spent"].get(key, (0.0, 0))
            if count:
                each = 1e3 * seconds / count
                yield Figure(f"{what}, {key}", f"{each:.1f} ms", target, each / least)


def audit(data: dict[str, Any]) -> Iterator[Figure]:
    for name, row in data["plans"].items():
        value = f"{1000 * row['all']:.0f} ms, {row['samples']} samples, {row['pairs']} pairs"
        yield Figure(f"audit of {name}", value, "0.1 s", row["all"] / 0.1)


def study_nulls(data: dict[str, Any]) -> Iterator[Figure]:
    for conditions, tests in data["null"].items():
        for name, row in tests.items():
            value = f"{row['rate']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
            yield Figure(f"false alarms, {conditions} conditions, {name}", value, "5 %", row["rate"] / 0.05)


def toolbox(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"]:
        value = f"{row['cpu_seconds']:.1f} s, {row['actions']} actions, {row['status']}"
        yield Figure(f"toolbox of {row['parts']} parts, {row['what']}", value)


def anytime(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"]:
        best = ", ".join(f"{cost:.2f} after {at:.1f} s" for at, cost in row["incumbents"])
        yield Figure(f"search, {Path(row['scene']).stem}", f"{best}; {row['status']}, gap {row['gap']:.0%}")


def scale(data: dict[str, Any]) -> Iterator[Figure]:
    rows = data["rows"]
    for row in rows:
        most = max(row["parent_mb"], row["worker_mb"])
        value = f"{row['frames_per_second_and_job']:,.0f} frames/s and core, {most:.0f} MB a process"
        against, ratio = "one process", row["recordings_per_second"] / rows[0]["recordings_per_second"]
        if "Dask" in row["run"]:
            against, ratio = "time of local processes", row["seconds"] / rows[1]["seconds"]
        yield Figure(f"{row['recordings']} recordings, {row['run']}", value, against, ratio)


def live(data: dict[str, Any]) -> Iterator[Figure]:
    for row in data["rows"]:
        against, ratio = f"{data['budget_ms']:g} ms a frame", row["p99_ms"] / data["budget_ms"]
        value = f"p50 {row['p50_ms']:.1f} ms, p99 {row['p99_ms']:.1f} ms"
        yield Figure(f"live, {row['source']} at {data['rate']:g} frames/s", value, against, ratio)
        yield Figure(f"live, {row['source']} all at once", f"{row['at_once']:,.0f} frames/s")


def no_figures(data: dict[str, Any]) -> Iterator[Figure]:
    yield from ()


def _growth(what: str, rows: list[dict[str, Any]], by: str) -> Iterator[Figure]:
    """Exponent of the growth of time."""
    if len({row[by] for row in rows}) > 1:
        power = np.polyfit(np.log([row[by] for row in rows]), np.log([row["ms"] for row in rows]), 1)[0]
        sizes = f"{min(row[by] for row in rows)} to {max(row[by] for row in rows)} {by}"
        yield Figure(f"growth, {what}", f"time ~ {by}^{power:.2f}", sizes)


SCRIPTS: tuple[Script, ...] = (
    Script("correctness", correctness, ("--postures", "1000")),
    Script("scoring", scoring, ("--frames", "100000", "--repeat", "2")),
    Script("distribution", distribution, ("--frames", "20000", "--repeat", "2")),
    Script("reading", reading, ("--messages", "6000", "--repeat", "2")),
    Script("whole_command", whole_command, ("--minutes", "1")),
    Script("quadratic", quadratic, ("--poses", "2000", "--repeat", "2")),
    Script("soft", soft, ("--poses", "5000")),
    Script("surrogate_speed", surrogate_speed),
    Script("enabler", enabler, ("--tasks", "2")),
    Script("sqp", sqp, ("--slices", "20", "--repeat", "1")),
    Script("reachability", reachability),
    Script("bounds", bounds, ("--runs", "1")),
    Script("cost_models", cost_models, ("--runs", "1", "--models", "convex")),
    Script("poses", poses, ("--starts", "8")),
    Script("starts", starts, ("--sequences", "1", "--starts", "10", "--cost", "convex")),
    Script("optima", optima, ("--slices", "5")),
    Script("path", path, ("--repeat", "1", "--no-growth")),
    Script("plan_time", plan_time, ("screwdriver_panda", "--repeat", "1")),
    Script("audit", audit, ("screwdriver_panda", "--repeat", "2")),
    Script("random_start", random_start, ("--draws", "1", "--variants", "paper")),
    Script("toolbox", toolbox, ("--parts", "2", "--seconds", "5")),
    Script("anytime", anytime, ("--seconds", "10")),
    Script("study_nulls", study_nulls, ("--studies", "20", "--files", "0")),
    Script("scale", scale, ("--recordings", "4", "--minutes", "1", "--subset", "2", "--mcap", "1")),
    Script("live", live, ("--seconds", "4", "--frames", "1000", "--kinds", "rows")),
    Script("one_camera", no_figures, needs="a folder of one-camera recordings; python benchmarks/one_camera.py FOLDER"),
)
"""All scripts in the order of the table."""
