"""From actions to paths: features and constraints of a sequence, the path problem, and its relaxations.

actions -> `Phases` (switches, loads, slices) -> `PathProblem` on some knots -> `PathBounds` for the search
"""

from __future__ import annotations
