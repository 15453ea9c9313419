"""What many files share: a browser, and which files are slow.

Slow ones start browsers, clusters, planners or many processes; `make test-fast` leaves them out.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browser import chromium, offline

SLOW = (
    "test_docs_code",
    "test_dreba_reach",
    "test_dreba_report_browser",
    "test_execution_cli",
    "test_execution_faults",
    "test_execution_resume",
    "test_execution_run",
    "test_execution_server",
    "test_experiment_screwdriver",
    "test_fuzz_inputs",
    "test_lgp_bad_input",
    "test_lgp_page",
    "test_lgp_page_browser",
    "test_lgp_path",
    "test_lgp_plan",
    "test_lgp_toolbox",
    "test_live_file",
    "test_live_foxglove",
    "test_live_lines",
    "test_report_browser",
    "test_scale_cluster",
    "test_scale_dataset",
    "test_scale_fan_out",
    "test_study_command",
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Give a browser without a network and without a display, one for all tests of a file."""
    with chromium(tmp_path_factory.mktemp("profile"), "--disable-gpu") as found:
        offline(found)
        yield found


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of slow files."""
    for item in items:
        if item.path.stem in SLOW:
            item.add_marker(pytest.mark.slow)
