"""Reproduction of the two experiments of Busch, Toussaint & Lopes (ICRA 2018): runs, statistics, figures, reports.

`screwdriver_experiment` (section III: the choice of a table) and `toolbox` (section IV: the order of actions) are the
entries; `published` holds what the paper reports.
"""

from __future__ import annotations
