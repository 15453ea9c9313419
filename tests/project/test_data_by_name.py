"""Every entrance for angles reads named data by name: the same numbers in any order and form, or an error in one line.

The entrances are found, not listed: the public functions and methods that take arrays or tables, for every kind of
model, and the commands that read a recording or poses. One that is new fails here until it is called.
"""

from __future__ import annotations

import inspect
import json
import pickle
import warnings
from collections import namedtuple
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import dreba
import dreba.cli
import reba
import reba.cli
from reba.posture.columns import COLUMNS
from tests.support.invoke import invoke
from tests.support.says import says

N = 40
TABLES = ("Any", "Array", "ArrayLike", "DataFrame", "PostureTable", "Poses")
"""Types of arguments that may hold angles."""
OTHERS = frozenset(
    ("y", "reba", "sample_weight", "which", "load", "factors", "changes", "notes", *reba.Rules.__annotations__)
)
"""Arguments of these types that hold no angles."""
QUICK: dict[str, dict[str, Any]] = {
    "convex": {"knots": 3},
    "graduated": {"updates": 2},
    "net": {"epochs": 1, "layers": (4,)},
    "soft": {"updates": 2},
}


@cache
def poses() -> dreba.Poses:
    return dreba.sample(N, rng=5)


def table() -> pd.DataFrame:
    return pd.DataFrame(poses().angles, columns=list(COLUMNS))


@cache
def order() -> list[str]:
    return [str(name) for name in np.random.default_rng(3).permutation(COLUMNS)]


def other_order() -> pd.DataFrame:
    return table()[order()]


@cache
def fitted(kind: str, joints: tuple[str, ...] | None = None) -> dreba.Surrogate:
    return dreba.KINDS[kind](**QUICK.get(kind, {}), joints=joints).fit(table(), poses().reba)


def of_scores(scores: reba.Scores) -> list[Any]:
    return [scores.data.fillna(-1).to_numpy(), scores.angles, scores.explain(0.0).to_dict(), scores.improve(1.0)]


def of_factors(scores: reba.ScoreArrays) -> list[Any]:
    return [scores[name] for name in reba.SCORE_COLUMNS]


def posture_table(data: Any) -> Any:
    """Return a table as a posture table; other forms are for `reba.score` itself."""
    if not isinstance(data, pd.DataFrame):
        return data
    data = data.copy()
    data["time" if data.columns.nlevels == 1 else ("time", "")] = np.arange(float(len(data)))
    return reba.PostureTable(data)


CALLS: dict[str, Callable[[Any], Any]] = {
    "reba.angle_table(data)": reba.angle_table,
    "reba.score(postures)": lambda data: of_scores(reba.score(data)),
    "reba.score_array(angles)": lambda data: of_factors(reba.score_array(data)),
    "reba.score_probabilities(angles)": lambda data: reba.score_probabilities(data, error="optical"),
    "reba.PostureTable(data)": lambda data: of_scores(reba.score(posture_table(data))),
    "dreba.Poses(angles)": lambda data: dreba.Poses(data, poses().reba).angles,
}
"""Results of the entrances that are no methods of a model."""
RECORDS = frozenset((
    "reba.Scores(data)", "reba.Scores(postures)", "reba.write_postures(postures)", "dreba.compare(poses)",
    "dreba.evaluate(poses)", "dreba.fit_to(train)", "dreba.fit_to(held_out)", "dreba.write_report(poses)",
    "reba.ScoreDistribution(mean_low)", "reba.ScoreDistribution(mean_high)", "reba.ScoreDistribution(level_low)",
    "reba.ScoreDistribution(level_high)",
))  # fmt: skip
"""Entrances that take a record whose own entrance is among `CALLS`."""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield the public functions, constructors and methods of the packages that know the posture table."""
    for package in (reba, dreba):
        for name in package.__all__:
            member = getattr(package, name)
            if not inspect.isclass(member):
                if inspect.isfunction(member):
                    yield f"{package.__name__}.{name}", member
                continue
            if not issubclass(member, dreba.Surrogate | tuple | Exception) and member is not reba.Factors:
                yield f"{package.__name__}.{name}", member
            for method, function in inspect.getmembers(member, inspect.isfunction):
                if function.__module__.partition(".")[0] == package.__name__ and not method.startswith("_"):
                    yield f"{package.__name__}.{name}.{method}", function


def entrances() -> dict[str, str]:
    """Return the places that may take angles, and the name of the argument."""
    found = {}
    for name, function in public():
        for parameter in inspect.signature(function).parameters.values():
            words = str(parameter.annotation).replace("|", " ").replace(".", " ").replace("[", " [").split()
            holds = not any("dict" in word or "tuple" in word for word in words) and any(w in TABLES for w in words)
            if holds and parameter.name not in OTHERS and not name.startswith("reba.score_parts"):
                found[f"{name}({parameter.name})"] = parameter.name
    return found


def methods() -> dict[str, str]:
    """Return the names of the methods of models that take angles, and those of their argument."""
    start = "dreba.Surrogate."
    return {name.removeprefix(start).partition("(")[0]: given for name, given in entrances().items() if start in name}


def model_calls() -> dict[str, Callable[[Any], Any]]:
    """Return a call for each method of each kind of model; of `fit` the values of the new model are the result."""

    def call(kind: str, method: str) -> Callable[[Any], Any]:
        if method == "fit":
            return lambda data: dreba.KINDS[kind](**QUICK.get(kind, {})).fit(data, poses().reba).value(poses().angles)
        more = [poses().reba] if method == "score" else []
        return lambda data: getattr(fitted(kind), method)(data, *more)

    calls = {f"{kind}.{method}": call(kind, method) for kind in dreba.KINDS for method in methods()}
    del calls["net.gauss_newton"]  # has none, and says so
    return calls


EVERY = {**CALLS, **model_calls()}
MODELS = model_calls()


def test_every_entrance_is_called() -> None:
    of_models = {name for name in entrances() if name.split(".")[1].endswith(("Model", "Surrogate"))}
    assert set(entrances()) - of_models == {*CALLS, *RECORDS}
    assert set(methods()) >= {"fit", "predict", "value", "gradient", "value_and_gradient", "hessian", "gauss_newton"}
    assert set(methods().values()) == {"X", "angles"}


FORMS: dict[str, Callable[[], Any]] = {
    "other order": other_order,
    "other columns": lambda: other_order().assign(time=np.arange(float(N)), id="a", load=0.0),
    "objects": lambda: other_order().astype(object),
    "mapping": lambda: {name: other_order()[name].to_numpy() for name in order()},
    "rows": lambda: other_order().to_dict("records"),
    "rows of series": lambda: [row for _, row in other_order().iterrows()],
    "named tuples": lambda: list(other_order().itertuples(index=False)),
    "records": lambda: other_order().to_records(index=False),
    "structured": lambda: np.array(other_order().to_records(index=False)),
    "arrow": lambda: pa.Table.from_pandas(other_order()),
    "arrow batch": lambda: pa.RecordBatch.from_pandas(other_order()),
}


def same(found: Any, expected: Any) -> None:
    if isinstance(expected, list | tuple):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            same(one, other)
    elif isinstance(expected, np.ndarray):
        np.testing.assert_array_equal(found, expected)
    else:
        assert found == expected


@cache
def expected(name: str) -> Any:
    return EVERY[name](table())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", EVERY)
def test_the_order_and_the_form_of_named_data_change_nothing(name: str, form: str) -> None:
    same(EVERY[name](FORMS[form]()), expected(name))


@pytest.mark.parametrize("name", EVERY)
def test_what_cannot_be_read_by_name_is_refused(name: str) -> None:
    call = EVERY[name]
    twice = pd.concat([other_order(), table()[["neck_twist"]]], axis=1)
    words = other_order().astype(object)
    words.iloc[3, order().index("neck_twist")] = "bent"
    truth = other_order().assign(neck_twist=True)
    for data in (twice, words, truth):
        with pytest.raises(reba.RebaError) as caught:
            call(data)
        says(caught, "neck_twist")
    with pytest.raises(reba.RebaError):
        call(pa.Table.from_pandas(other_order()).append_column("neck_twist", pa.array(np.zeros(N))))
    numbered = [COLUMNS.index(label) for label in order()]
    for data in (
        table().set_axis(range(22), axis=1)[numbered],
        other_order().set_axis(pd.MultiIndex.from_product([["angles"], order()]), axis=1),
        other_order().T,
    ):
        with pytest.raises(reba.RebaError):
            call(data)


@pytest.mark.parametrize("name", EVERY)
def test_a_missing_column_is_unmeasured_or_refused(name: str) -> None:
    part = other_order().drop(columns="neck_twist")
    near = other_order().rename(columns={"neck_twist": "neck_twst"})
    if name not in MODELS:
        same(EVERY[name](part), EVERY[name](table().assign(neck_twist=np.nan)))
    elif not name.endswith(".fit"):
        with pytest.raises(dreba.ModelError) as caught:
            EVERY[name](part)
        says(caught, "neck_twist")
    if name not in ("reba.score(postures)", "reba.PostureTable(data)"):  # these warn in their notes
        with pytest.raises(reba.RebaError) as caught:
            EVERY[name](near)
        says(caught, "'neck_twst'", "did you mean 'neck_twist'")


@pytest.mark.parametrize("name", EVERY)
def test_radians_are_told_at_every_entrance(name: str) -> None:
    if name.endswith(".fit"):  # the reference values after it are in degrees

        def call(data: Any) -> None:
            dreba.KINDS[name.partition(".")[0]](**QUICK.get(name.partition(".")[0], {})).fit(data, poses().reba)

    else:
        call = EVERY[name]
    with pytest.warns(reba.RadiansWarning, match="degrees") as caught:
        call(np.radians(other_order()))
    assert len({str(warning.filename) for warning in caught}) == 1
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        EVERY[name](other_order())


@pytest.mark.parametrize(
    "name", [name for name in EVERY if name not in ("reba.score(postures)", "reba.PostureTable(data)")]
)
def test_arrays_of_another_width_are_told_the_order(name: str) -> None:
    for width in (21, 23):
        with pytest.raises(reba.RebaError) as caught:
            EVERY[name](np.zeros((N, width)))
        if not name.startswith("quadratic.fit"):
            says(caught, "22", "reba.COLUMNS")


@pytest.mark.parametrize("kind", dreba.KINDS)
@pytest.mark.parametrize("joints", [None, tuple(reversed(COLUMNS))])
def test_names_survive_saving(kind: str, joints: tuple[str, ...] | None, tmp_path: Path) -> None:
    model = fitted(kind, joints)
    assert model.joints_ == (joints or COLUMNS)
    model.save(tmp_path / "model.json")
    for again in (model, dreba.load(tmp_path / "model.json"), pickle.loads(pickle.dumps(model))):
        assert again.feature_names_in_.tolist() == list(model.joints_)
        assert again.n_features_in_ == 22
        same(again.predict(other_order()), model.value(table()))
        same(again.gradient(other_order()), model.gradient(table()))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            again.predict(table()[list(model.joints_)].to_numpy())


def test_a_pose_by_name() -> None:
    model = fitted("quadratic")
    row = other_order().iloc[4]
    record = namedtuple("record", order())(*row)
    categories = row.set_axis(pd.CategoricalIndex(order()))
    for pose in (row, categories, row.to_dict(), record, other_order().to_records(index=False)[4], row.astype(object)):
        assert model.value(pose) == model.value(poses().angles[4])
        same(reba.angle_table(pose), poses().angles[4:5])
    for wrong in (
        pd.concat([row, row[:1]]),
        row.set_axis(range(22))[::-1],
        [row, row.to_list()],
        table()["neck_twist"].iloc[:22],
    ):
        with pytest.raises(dreba.ModelError):
            model.value(wrong)


# Commands.


def commands() -> dict[str, click.Command]:
    """Return the commands that read a recording or poses and print JSON."""
    found = {}
    for group in (reba.cli.cli, dreba.cli.cli):
        package = "reba" if group is reba.cli.cli else "dreba"
        for name, command in group.commands.items():
            options = {parameter.name for parameter in command.params}
            if options & {"profile", "poses_file"} and "as_json" in options:
                found[f"{package} {name}"] = command
    return found


ARGUMENTS: dict[str, list[str]] = {
    "reba compare": ["FILE", "FILE"],
    "reba convert": ["FILE", "-o", "out.csv"],
    "reba explain": ["FILE", "--at", "1"],
    "reba improve": ["FILE"],
    "reba info": ["FILE"],
    "reba score": ["FILE", "-o", "out.parquet"],
    "dreba compare": ["quadratic", "convex", "--poses", "FILE", "--tasks", "0"],
    "dreba evaluate": ["quadratic", "--poses", "FILE"],
    "dreba fit": ["--poses", "FILE", "-o", "model.json"],
}


def plain(value: Any) -> Any:
    """Return the output of a command without what differs between two runs: hashes and times of this machine."""
    if isinstance(value, dict):
        return {
            key: plain(item) for key, item in value.items() if not key.startswith(("seconds_per", "sha", "command"))
        }
    return [plain(item) for item in value] if isinstance(value, list) else value


SLOW = ("dreba compare", "reba improve")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in commands()]
)
def test_commands_read_tables_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    time = np.arange(5000) / 10.0
    drawn = dreba.sample(5000, rng=6).angles
    frames = pd.DataFrame(drawn, columns=list(COLUMNS))
    outputs = []
    for data in (frames.assign(time=time), frames[order()].assign(time=time, id=7.0)):
        data.to_csv("walk.csv", index=False)
        arguments = ["walk.csv" if argument == "FILE" else argument for argument in ARGUMENTS[name]]
        result = invoke(commands()[name], [*arguments, "--json"])
        assert result.exit_code == 0, result.output
        written = [pd.read_csv(path)[["time", *COLUMNS]] for path in Path().glob("out.csv")]
        written += [pd.read_parquet(path) for path in Path().glob("out.parquet")]
        models = [plain(json.loads(path.read_text())) for path in Path().glob("model.json")]
        # Older versions of click have what goes to standard error among it.
        printed = next(line for line in result.stdout.splitlines() if line.startswith("{"))
        outputs.append((plain(json.loads(printed)), [data.to_dict() for data in written], models))
    assert outputs[0] == outputs[1]
