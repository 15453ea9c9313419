"""Tables of measurement error: shipped ones with the source of every number, and those of users."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import reba
from reba.method.measurement_error import MEASUREMENTS, SHIPPED, MeasurementError
from reba.posture.columns import COLUMNS_OF, INDEX
from tests.support.paths import ROOT
from tests.support.says import says


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_shipped_tables_have_every_angle_with_its_source(name: str) -> None:
    error = MeasurementError.of(name)
    assert error.name == name
    assert error.title
    assert all(0.5 < sd < 30.0 for sd in error.sd), "every angle has an error"
    assert error.bias == (0.0,) * len(reba.COLUMNS)
    for column, source in zip(reba.COLUMNS, error.sources, strict=True):
        assert source, column
        if column not in error.chosen:
            assert any(digit.isdigit() for digit in source), f"{column}: a source has a year"
    for angle, columns in COLUMNS_OF.items():
        assert len({error.sd[INDEX[column]] for column in columns}) == 1, f"{angle}: sides are alike"


def test_every_source_is_in_the_references() -> None:
    references = " ".join((ROOT / "docs" / "references.md").read_text(encoding="utf-8").split())
    cited = {
        word.strip("(;,:")
        for name in MEASUREMENTS
        for source in MeasurementError.of(name).sources
        for word, after in zip(source.split(), source.split()[1:], strict=False)
        if word[:1].isupper() and after in ("et", "&")
    }
    assert {"Zhang", "Morrow", "McHugh"} <= cited
    assert [name for name in sorted(cited) if name not in references] == []


def test_the_tables_are_the_names() -> None:
    assert sorted(path.stem for path in SHIPPED.glob("*.toml")) == sorted(MEASUREMENTS)


def test_coarser_measurements_have_larger_errors() -> None:
    optical, inertial, several, one = (MeasurementError.of(name).sd for name in MEASUREMENTS)
    assert all(a <= b for a, b in zip(optical, inertial, strict=True))
    assert all(a <= b for a, b in zip(several, one, strict=True))


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "our_lab.toml"
    path.write_text(
        'base = "inertial"\ntitle = "ours"\nwrist_twist_right = 12.5\nwrist_twist = 9\n'
        "[trunk_flexion]\nsd = 2.5\nbias = -1.5\nsource = 'test of March'\n",
        encoding="utf-8",
    )
    error, base = MeasurementError.of(path), MeasurementError.of("inertial")
    assert (error.name, error.title) == ("our_lab", "ours")
    assert [error.sd[INDEX[f"wrist_twist_{side}"]] for side in ("left", "right")] == [9.0, 12.5]
    trunk = INDEX["trunk_flexion"]
    assert (error.sd[trunk], error.bias[trunk], error.sources[trunk]) == (2.5, -1.5, "test of March")
    assert error.sd[INDEX["neck_twist"]] == base.sd[INDEX["neck_twist"]]
    assert "wrist_twist_left" in base.chosen
    assert "wrist_twist_left" not in error.chosen
    assert MeasurementError.of(str(path)) == error
    assert MeasurementError.of(error) is error


def test_columns_without_an_entry_have_no_error() -> None:
    error = MeasurementError.of({"knee_flexion": {"sd": np.int64(4), "bias": np.float32(1.0)}})
    assert {column for column, sd in zip(reba.COLUMNS, error.sd, strict=True) if sd} == {
        "knee_flexion_left",
        "knee_flexion_right",
    }
    assert error.to_dict()["bias"]["knee_flexion_left"] == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("trunk_flexion = ", "not TOML"),
        ("", "no error of any column"),
        ("title = 'ours'\n", "no error of any column"),
        ("[trunk_flexion]\nsd = inf\n", "expected a finite number"),
        ("[trunk_flexion]\nsd = 400\n", "expected 0 to 180"),
        ("[trunk_flexion]\nbias = 1.0\n", "sd is missing"),
        ("[trunk_flexion]\nsd = 1.0\nbias = 999\n", "bias is 999"),
        ("[trunk_flexoin]\nsd = 1.0\n", "did you mean 'trunk_flexion'"),
        ('base = "lidar"\n', "expected one of optical"),
    ],
)
def test_files_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(reba.PostureError) as caught:
        MeasurementError.of(path)
    says(caught, "bad.toml", message)


@pytest.mark.parametrize("wrong", [(), (1.0,) * 21, [1.0] * 22, (float("nan"),) * 22, (-1.0,) * 22, ("x",) * 22, None])
def test_records_hold_one_number_for_each_column(wrong: object) -> None:
    with pytest.raises(reba.PostureError) as caught:
        MeasurementError(sd=wrong)  # type: ignore[arg-type]
    says(caught, "sd", "22 numbers from 0 to 180")


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(reba.PostureError) as caught:
        MeasurementError.of("nowhere.toml")
    says(caught, "nowhere.toml", "cannot be read")
