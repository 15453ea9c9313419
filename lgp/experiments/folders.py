"""Whose results a folder holds: one experiment does not write over the results of another one."""

from __future__ import annotations

from pathlib import Path

from lgp.errors import LgpError
from lgp.files import SETTINGS, SUMMARY


def check_folder(folder: str | Path, experiment: str) -> None:
    """Refuse a folder that holds the results of another experiment than this one: screwdriver, toolbox or all.

    Raises:
        LgpError: it does.
    """
    held = experiment_in(folder)
    if held not in (None, experiment):
        raise LgpError(f"{folder}: holds the results of another experiment, {held}; give another folder")


def experiment_in(folder: str | Path) -> str | None:
    """Return the experiment whose results a folder holds, None without any; finished or not."""
    place = Path(folder)
    if (place / SETTINGS).exists():
        return "screwdriver"
    if (place / "runs.parquet").exists():
        return "toolbox"
    parts = (*place.glob(f"screwdriver/*/{SETTINGS}"), *place.glob(f"toolbox/*/{SUMMARY}"))
    return "all" if parts else None
