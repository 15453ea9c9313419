"""Summary of a recording, recognised or not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reba.errors import ProfileError
from reba.readers.info import info
from tests.support.says import says
from tests.support.synthetic_bodies import table_file


def test_info_has_ranges_of_a_table_and_the_reason_without_a_profile(tmp_path: Path) -> None:
    good = info(table_file(tmp_path / "a.csv", ["0.0,10,5,1", "0.1,20,5,1"]))
    assert good.usable
    assert good.ranges["trunk_flexion"] == (10.0, 15.0, 20.0)
    assert "wrist_twist_left" in good.unmeasured
    assert good.to_dict()["found"] == good.present
    json.dumps(good.to_dict(), allow_nan=False)
    bad = info(table_file(tmp_path / "b.csv", ["0.0,1,2"], "time,foo,bar"))
    assert not bad.usable
    assert "foo, bar" in bad.recognised
    json.dumps(bad.to_dict(), allow_nan=False)


@pytest.mark.parametrize("given", ["topic", "body"])
def test_a_stream_or_body_that_is_not_there_is_an_error(given: str, tmp_path: Path) -> None:
    path = table_file(tmp_path / "a.csv", ["0.0,10,5,1", "0.1,20,5,1"])
    with pytest.raises(ProfileError) as caught:
        info(path, **{given: "bob"})
    says(caught, path, "'bob'")


def test_a_name_with_a_plus_is_one_stream(tmp_path: Path) -> None:
    path = table_file(tmp_path / "lift + carry.csv", ["0.0,10,5,1", "0.1,20,5,1"])
    found = info(path, topic="lift + carry")
    assert [(account["stream"], account["used"]) for account in found.accounts] == [("lift + carry", 2)]
    assert [stream.used for stream in found.streams] == [True]
