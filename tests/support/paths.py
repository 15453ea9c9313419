"""Where the checkout and the references beside it are."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATASETS = ROOT / "datasets"
SHARED = ROOT.parent / "shared"
"""References beside the checkout; tests that need them skip where they are missing."""
RECORDINGS = SHARED / "recordings"
"""Real recorded people, by folder; used in place."""
