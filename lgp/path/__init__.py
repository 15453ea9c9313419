"""From actions to paths: features and constraints of a sequence, the path problem, and its relaxations.

actions -> `Phases` (switches, loads, slices) -> `PathProblem` over some kept slices -> `PathBounds` for the search
"""

from __future__ import annotations
