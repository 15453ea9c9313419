"""Runs with known answers from both initial postures, and their summary."""

import pytest

from lgp.experiments.summary import summarise
from tests.support.screwdriver_runs import made


@pytest.fixture(scope="session")
def both():
    return made("rest", "random")


@pytest.fixture(scope="session")
def summary(both):
    return summarise(*both, {"seed": 0})
