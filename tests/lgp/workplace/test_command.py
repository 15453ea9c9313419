"""`lgp improve`: table, JSON, page."""

import json

import pandas as pd
import pytest

from lgp.cli import cli
from tests.support.invoke import invoke

pytestmark = pytest.mark.slow
SMALL = ["--heights", "0.8", "1.0", "--distances", "0.3", "0.4"]


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "bent.csv"
    rows = {"time": [0.0, 0.1], "trunk_flexion": 65.0, "upper_arm_flexion": 60.0, "lower_arm_flexion": 20.0}
    pd.DataFrame(rows).to_csv(path, index=False)
    return str(path)


def test_the_terminal_has_the_result_and_the_grid(recording, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    done = invoke(cli, ["improve", recording, "--at", "0", *SMALL])
    assert done.exit_code == 0, done.output
    for words in ("as measured", "hands now", "REBA by height", "!", "Not measured, taken as neutral"):
        assert words in done.output
    assert max(map(len, done.output.splitlines())) <= 80


def test_json_and_page(recording, tmp_path):
    page = tmp_path / "moved.html"
    done = invoke(cli, ["improve", recording, "--at", "0", *SMALL, "--json", "--report", str(page)])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["report"] == str(page)
    (moment,) = result["moments"]
    assert moment["best"]["reba"] <= moment["unchanged"]["reba"] <= moment["measured"]["reba"]
    assert {"height", "distance", "side", "reba", "moved"} == set(moment["grid"][0])
    assert "Where the hands are: bent.csv" in page.read_text(encoding="utf-8")
    assert str(tmp_path) not in page.read_text(encoding="utf-8")
