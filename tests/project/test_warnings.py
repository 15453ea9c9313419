"""Warnings point to the line of the user, however deep they come from."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import dreba
import reba
from reba.errors import PACKAGES
from tests.support.paths import ROOT


def test_one_function_warns() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    own = [path.name for path in files if re.search(r"\bwarnings\.warn\(|\bimport warn\b", path.read_text("utf-8"))]
    assert own == ["errors.py"]


def test_a_recording_in_radians_is_told_where_it_is_read(tmp_path: Path) -> None:
    file = tmp_path / "radians.csv"
    time = np.arange(50) / 10
    pd.DataFrame({"time": time, "trunk_flexion": 0.4 + 0.3 * np.sin(time)}).to_csv(file, index=False)
    with pytest.warns(reba.RadiansWarning) as caught:
        reba.read(file)
    assert {warning.filename for warning in caught} == {__file__}


def test_other_warnings_are_told_there_too(tmp_path: Path) -> None:
    frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
    scores = reba.score(frames)
    with pytest.warns(DeprecationWarning, match="write_report") as caught:
        reba.write_report(tmp_path / "report.html", scores)
    assert caught[0].filename == __file__
    ignorant = dreba.KINDS["quadratic"]().fit(np.eye(22) * 30.0, np.arange(22) % 4 + 1.0)
    with pytest.warns(dreba.FactorWarning) as caught:
        ignorant.value(np.zeros((1, 22)), coupling="poor")
    assert caught[0].filename == __file__
