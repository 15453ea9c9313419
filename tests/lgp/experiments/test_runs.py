"""Tables of runs: refused tables, and a folder of runs that survives a killed process."""

import json

import numpy as np
import pandas as pd
import pytest

import reba
from lgp.errors import LgpError
from lgp.experiments.runs import (
    CONDITIONS,
    JOURNAL,
    NUMBERS,
    PATH_COLUMNS,
    RUN_COLUMNS,
    TABLES,
    RunStore,
    check_paths,
    check_runs,
    empty,
    pivot,
)
from reba.posture.columns import COLUMNS
from tests.support.says import says

SETTINGS = {"scene": "screwdriver", "cost": "quadratic", "seed": 0}


def made(run, initial="rest", failed=(), tables=("left", "center", "left"), scores=(5.0, 3.0, 4.0)):
    """Return the tables of one run, with the given table and score at the grasp per condition."""
    heights = np.random.default_rng(run).uniform(0.6, 1.6, 3)
    rows, paths = [], []
    for condition, table, score in zip(CONDITIONS, tables, scores, strict=True):
        ok = condition not in failed
        key = {"run": run, "condition": condition, "initial": initial}
        row = {**key, "seed": 0, "feasible": ok, "seconds": 0.5, "reason": "" if ok else "0.1 m too far", "faults": 0}
        row |= {f"height_{name}": height for name, height in zip(TABLES, heights, strict=True)}
        row |= {"actions": "grasp(1, baxter.left, screwdriver)" if ok else "", "table": table if ok else None}
        row |= {"chosen_height": heights[TABLES.index(table)], "reba_grasp": score, "reba_mean": score - 1, "cost": 1.0}
        row |= {"duration": 6.0, "robot_effort": 0.5, "human_effort": 0.25}
        if not ok:
            row |= dict.fromkeys(NUMBERS, np.nan)
        rows.append(row)
        if ok:
            scores = np.linspace(1.0, score, 6)
            path = pd.DataFrame({"slice": range(6), "phase": np.repeat(range(3), 2), "reba": scores, "load": 0.0})
            paths.append(path.assign(**key, time=path["slice"] + 1.0, **dict.fromkeys(COLUMNS, 10.0)))
    return pd.DataFrame(rows)[list(RUN_COLUMNS)], pd.concat(paths)[list(PATH_COLUMNS)] if paths else empty(PATH_COLUMNS)


def joined(*parts):
    """Return runs and paths of several runs."""
    return tuple(pd.concat(tables, ignore_index=True) for tables in zip(*parts, strict=True))


def test_checked_runs_have_the_documented_columns_types_and_order():
    runs = check_runs(joined(made(1, "random"), made(1), made(0))[0].sample(frac=1, random_state=0))
    assert list(runs.columns) == list(RUN_COLUMNS)
    assert {name: str(kind) for name, kind in runs.dtypes.items()} == RUN_COLUMNS
    assert runs["initial"].tolist() == ["rest"] * 6 + ["random"] * 3
    assert runs["run"].tolist() == [0, 0, 0, 1, 1, 1, 1, 1, 1]
    assert runs["condition"].tolist() == [*CONDITIONS] * 3


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        (lambda runs: runs.drop(columns="cost"), ("'cost' is missing", "expected")),
        (lambda runs: runs.assign(colour="red"), ("'colour' is unknown", "expected")),
        (lambda runs: runs.assign(condition="lazy"), ("condition 'lazy'", "ergonomic")),
        (lambda runs: runs.assign(initial="lying"), ("initial 'lying'", "rest")),
        (lambda runs: runs.assign(table="floor"), ("table 'floor'", "left")),
        (lambda runs: runs.assign(reba_grasp=np.nan), ("feasible", "reba_grasp")),
        (lambda runs: runs.assign(run="first"), ("type",)),
        (lambda runs: pd.concat([runs, runs]), ("run 0", "two rows", "keep one")),
        (lambda runs: runs.assign(chosen_height=2.0), ("chosen_height", "height_left")),
        (lambda runs: runs.assign(height_right=[1.0, 1.1, 1.0]), ("run 0", "heights", "expected the same")),
    ],
)
def test_bad_runs_are_refused_in_one_line(change, facts):
    with pytest.raises(LgpError) as error:
        check_runs(change(made(0)[0]))
    says(error, *facts)


def test_a_slice_that_stands_twice_is_refused():
    paths = made(0)[1]
    with pytest.raises(LgpError) as error:
        check_paths(pd.concat([paths, paths[paths["slice"] == 0]]))
    says(error, "slice 0", "two rows", "keep one")


def test_pivot_has_a_gap_where_a_run_is_infeasible():
    runs = check_runs(joined(made(0), made(1, failed=("ergonomic",)))[0])
    table = pivot(runs, "reba_grasp", "rest")
    assert list(table.columns) == list(CONDITIONS)
    assert table.loc[0].tolist() == [5.0, 3.0, 4.0]
    assert table.loc[1].isna().tolist() == [False, True, False]


def test_finished_runs_are_there_after_a_process_that_never_finished(tmp_path):
    first = RunStore(tmp_path, SETTINGS)
    first.append(*made(0))
    first.append(*made(2, failed=CONDITIONS))
    again = RunStore(tmp_path, SETTINGS)
    assert again.done("rest") == {0, 2}
    assert again.done("random") == set()
    again.append(*made(1))
    runs, paths = again.finish()
    expected = joined(made(0), made(1), made(2, failed=CONDITIONS))
    pd.testing.assert_frame_equal(runs, check_runs(expected[0]))
    pd.testing.assert_frame_equal(paths, check_paths(expected[1]))
    assert not (tmp_path / JOURNAL).exists()


def test_a_kill_in_the_middle_of_a_line_costs_that_run_only(tmp_path):
    store = RunStore(tmp_path, SETTINGS)
    for run in range(3):
        store.append(*made(run))
    journal = tmp_path / JOURNAL
    journal.write_bytes(journal.read_bytes()[:-40])
    again = RunStore(tmp_path, SETTINGS)
    assert again.done("rest") == {0, 1}
    again.append(*made(2))
    pd.testing.assert_frame_equal(again.finish()[0], check_runs(joined(made(0), made(1), made(2))[0]))


@pytest.mark.parametrize("written", [("paths.parquet",), ("paths.parquet", "runs.parquet")])
def test_a_kill_while_the_tables_are_written_neither_loses_nor_doubles_a_run(tmp_path, written):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    store.finish()
    before = {name: (tmp_path / name).read_bytes() for name in ("paths.parquet", "runs.parquet")}
    store.append(*made(1))
    journal = (tmp_path / JOURNAL).read_bytes()
    expected = store.finish()
    for name in set(before) - set(written):
        (tmp_path / name).write_bytes(before[name])
    (tmp_path / JOURNAL).write_bytes(journal)
    again = RunStore(tmp_path, SETTINGS)
    assert again.done("rest") == {0, 1}
    for mine, theirs in zip(again.finish(), expected, strict=True):
        pd.testing.assert_frame_equal(mine, theirs)


def test_a_second_start_and_more_runs_join_those_already_there(tmp_path):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    store.finish()
    again = RunStore(tmp_path, SETTINGS)
    again.append(*made(0, "random"))
    again.append(*made(1))
    runs, _ = again.finish()
    assert len(runs) == 9
    assert RunStore(tmp_path, SETTINGS).done("random") == {0}


def test_an_interrupted_experiment_plans_the_missing_runs_only(tmp_path):
    planned = []

    def plan(runs):
        planned.extend(runs)
        return [made(run) for run in runs]

    RunStore(tmp_path, SETTINGS).complete(2, "rest", plan)
    progress = []
    runs, _ = RunStore(tmp_path, SETTINGS).complete(
        3, "rest", plan, lambda done, wanted: progress.append((done, wanted))
    )
    assert planned == [0, 1, 2]
    assert progress == [(3, 3)]
    assert len(runs) == 9


def test_a_run_that_is_there_is_not_added_again(tmp_path):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    with pytest.raises(LgpError) as error:
        store.append(*made(0))
    says(error, "run 0", tmp_path, "already", "done")


def test_a_folder_keeps_to_its_settings(tmp_path):
    RunStore(tmp_path, SETTINGS)
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path, {**SETTINGS, "cost": "soft"})
    says(error, "cost", "'quadratic'", "'soft'", "another folder")


@pytest.mark.parametrize(("name", "text"), [("settings.json", "[1]"), ("settings.json", "{"), (JOURNAL, "{}\n")])
def test_damaged_files_are_named(tmp_path, name, text):
    RunStore(tmp_path, SETTINGS)
    (tmp_path / name).write_text(text)
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path, SETTINGS)
    says(error, name)


def test_a_damaged_table_is_named(tmp_path):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    store.finish()
    (tmp_path / "runs.parquet").write_bytes(b"PAR1")
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path, SETTINGS)
    says(error, tmp_path, "read", "another folder")


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path / "file" / "out", SETTINGS)
    says(error, tmp_path / "file" / "out", "another folder")


@pytest.mark.parametrize("finished", [True, False])
def test_runs_of_another_version_are_refused(tmp_path, monkeypatch, finished):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    if finished:
        store.finish()
    assert RunStore(tmp_path, SETTINGS).done("rest") == {0}
    monkeypatch.setattr("reba.provenance.__version__", "9.9.9")
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path, SETTINGS)
    says(error, tmp_path, f"dreba {reba.__version__}", "this is 9.9.9", "another folder")


def test_runs_of_an_unknown_version_are_refused(tmp_path):
    store = RunStore(tmp_path, SETTINGS)
    store.append(*made(0))
    store.finish()
    pd.read_parquet(tmp_path / "runs.parquet").to_parquet(tmp_path / "runs.parquet")
    with pytest.raises(LgpError) as error:
        RunStore(tmp_path, SETTINGS)
    says(error, "an unknown version", "another folder")


def test_settings_are_kept_as_json(tmp_path):
    RunStore(tmp_path, {"depths": (1, 2)})
    assert json.loads((tmp_path / "settings.json").read_text()) == {"depths": [1, 2]}
    RunStore(tmp_path, {"depths": (1, 2)})
