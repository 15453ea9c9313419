"""Names of the files that the commands write into a folder; `*` stands for any text."""

from __future__ import annotations

from typing import Final

PLAN_FILE: Final = "plan.json"
ACTIONS_FILE: Final = "plan.txt"
PLAN_FILES: Final = (PLAN_FILE, ACTIONS_FILE, "path.parquet", "postures.parquet", "postures-*.parquet")
"""A plan; all but the first only where they have content: postures of the first person, and of each other by name."""
PAGE: Final = "index.html"
ASSETS: Final = "assets"
PICTURES: Final = "pictures"
PICTURE_FILES: Final = (f"{PICTURES}/start.webp", f"{PICTURES}/action-*.webp")
PAGE_FILES: Final = (PAGE, f"{ASSETS}/*", *PICTURE_FILES)
"""The page of a plan."""
SETTINGS: Final = "settings.json"
"""Settings of the runs in a folder of the screwdriver experiment."""
JOURNAL: Final = "unfinished.jsonl"
"""Finished runs that are not in the tables yet, one JSON line per run."""
PLANS: Final = "plans"
"""Folder of the plans of an experiment, one folder each."""
SUMMARY: Final = "summary.json"
REPORT: Final = "report.html"
EXPERIMENT_FILES: Final = (
    SETTINGS, JOURNAL, "runs.parquet", "paths.parquet", SUMMARY, "figure_*.svg", REPORT, "sensitivity/*",
    "family/*", "pareto/*", "ergonomic/*", "non-ergonomic/*", "plans/*",
)  # fmt: skip
"""Both experiments."""
ALL_FILES: Final = (
    SUMMARY,
    REPORT,
    *(f"{part}/*/{name}" for part in ("screwdriver", "toolbox") for name in EXPERIMENT_FILES),
)
"""All experiments in all variants."""
STUDY_FILES: Final = (SUMMARY, "scores.parquet", REPORT)
"""A study."""
