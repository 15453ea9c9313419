"""The screwdriver experiment: content of one run, pairing of conditions, and report of finished runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from lgp.errors import LgpError
from lgp.experiments.runs import CONDITIONS, RunStore, check_paths, check_runs
from lgp.experiments.screwdriver import plan_run
from lgp.experiments.screwdriver_experiment import experiment_screwdriver
from lgp.experiments.summary import summarise, write_summary
from lgp.experiments.variants import setting, settings_of
from tests.support.lgp_worlds import needs_robots
from tests.support.says import says

pytestmark = [pytest.mark.slow, needs_robots]

Tables = tuple[pd.DataFrame, pd.DataFrame]


@pytest.fixture(scope="module")
def made() -> Tables:
    return plan_run(2, seed=0, slices=3, collisions=False)


def test_one_run_holds_every_condition(made: Tables) -> None:
    runs, paths = check_runs(made[0]), check_paths(made[1])
    assert tuple(runs["condition"]) == CONDITIONS
    assert runs["feasible"].all()
    assert len(paths) == 3 * 9
    last = paths[paths["slice"] == 8].set_index("condition")["reba"]
    assert last.to_dict() == runs.set_index("condition")["reba_grasp"].to_dict()
    assert np.allclose(paths.groupby("condition")["reba"].mean()[list(CONDITIONS)], runs["reba_mean"])


def test_conditions_are_what_they_say(made: Tables) -> None:
    plain, ergonomic, again = (made[0].iloc[number] for number in range(3))
    assert again["actions"] == plain["actions"]
    assert again["table"] == plain["table"]
    # The search with ergonomics may choose what the other chose, so it costs no more.
    assert ergonomic["cost"] <= again["cost"] * (1.0 + 1e-6)
    assert ergonomic["reba_grasp"] <= plain["reba_grasp"]


def test_an_experiment_reports_the_runs_of_its_folder(made: Tables, tmp_path: Path) -> None:
    pytest.importorskip("statsmodels")
    chosen, scene = setting("ours", "screwdriver", None, None, None)
    settings = settings_of("screwdriver", chosen, scene, collisions=False)
    store_settings = settings | {"cost": "convex", "seed": 0, "depth": 4}
    store = RunStore(tmp_path, store_settings)
    for run in range(3):
        store.append(*(table.assign(run=run) for table in made))
    progress: list[tuple[int, int]] = []
    rows = [{"choice": "as it is", "setting": "", "condition": "ergonomic", "left": 60.0, "center": 40.0, "right": 0.0,
             "n": 5, "of": 5, "remark": ""}]  # fmt: skip
    earlier = summarise(*store.tables(), store_settings, sensitivity=rows)
    write_summary(tmp_path / "summary.json", earlier)
    summary = experiment_screwdriver(
        tmp_path, variant="ours", collisions=False, runs=3, progress=lambda done, runs: progress.append((done, runs))
    )
    assert progress == []
    # What an earlier call varied is not lost where only the runs are asked for.
    assert summary["sensitivity"] == rows
    assert set(summary["starts"]) == {"rest"}
    assert len(pd.read_parquet(tmp_path / "runs.parquet")) == 9
    assert (tmp_path / "report.html").is_file()


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        ({"folder": None}, ("folder", "None", "path")),
        ({"runs": 0}, ("runs", "0", "1 or more")),
        ({"runs": "x"}, ("runs", "'x'")),
        ({"initial": "lying"}, ("'lying'", "rest, random")),
        ({"variant": "ous"}, ("'ous'", "ours")),
        ({"variant": "ours", "phase_seconds": 0.1}, ("phase_seconds", "0.1", "0.2")),
        ({"plans": True, "scheduler": "tcp://127.0.0.1:1"}, ("plans", "scheduler")),
    ],
)
def test_wrong_options_are_named(tmp_path: Path, options: dict[str, Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(LgpError) as error:
        experiment_screwdriver(**{"folder": tmp_path, **options})
    says(error, *facts)
