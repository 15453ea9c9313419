"""The screwdriver experiment: what one run holds, that runs are paired, and that a stopped experiment goes on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lgp.experiments import screwdriver
from lgp.experiments import screwdriver_experiment as screwdriver_experiment_
from lgp.experiments.runs import CONDITIONS, check_paths, check_runs
from tests.support.lgp_worlds import needs_robots

pytestmark = [pytest.mark.slow, needs_robots]

Tables = tuple[pd.DataFrame, pd.DataFrame]


@pytest.fixture(scope="module")
def made() -> Tables:
    return screwdriver.plan_run(2, seed=0, slices=3, collisions=False)


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


def test_a_stopped_experiment_goes_on(made: Tables, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("statsmodels")
    asked: list[int] = []

    def again(run: int, *_: object, **__: object) -> Tables:
        asked.append(run)
        return tuple(table.assign(run=run) for table in made)  # type: ignore[return-value]

    monkeypatch.setattr(screwdriver, "plan_run", again)
    screwdriver_experiment_.experiment(tmp_path, 2)
    told: list[tuple[int, int]] = []
    summary = screwdriver_experiment_.experiment(tmp_path, 3, progress=lambda done, wanted: told.append((done, wanted)))
    assert asked == [0, 1, 2]
    assert told == [(3, 3)]
    assert set(summary["starts"]) == {"rest"}
    assert len(pd.read_parquet(tmp_path / "runs.parquet")) == 9
    assert (tmp_path / "report.html").is_file()
