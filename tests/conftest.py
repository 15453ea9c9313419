"""What many files share: a browser, and hypothesis without time limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

from tests.support.browser import chromium, offline

# No test is timed: a busy machine is no defect.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Give a browser without a network and without a display, one for all tests of a file."""
    with chromium(tmp_path_factory.mktemp("profile"), "--disable-gpu") as found:
        offline(found)
        yield found
