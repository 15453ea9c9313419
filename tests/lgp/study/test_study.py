"""A complete study as a function: wrong arguments end in one line."""

from __future__ import annotations

from typing import Any

import pytest

from lgp.errors import LgpError
from lgp.study.study import run_study
from reba.checks import shown
from tests.support.says import says


@pytest.mark.parametrize("logs", [None, 3, object(), [1.5]])
def test_logs_are_paths(logs: Any) -> None:
    with pytest.raises(LgpError) as error:
        run_study(logs)
    says(error, "logs", shown(logs), "path")


@pytest.mark.parametrize("conditions", ["a,b", None, 3])
def test_conditions_are_names(conditions: Any) -> None:
    with pytest.raises(LgpError) as error:
        run_study(["x"], conditions=conditions)
    says(error, "conditions", repr(conditions), "list of names")
