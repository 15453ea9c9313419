"""Studies with participants: recordings in several conditions -> exact scores, paired statistics, HTML report.

labels -> recordings -> scoring -> analysis -> conclusions -> study -> report. Simulated studies: retarget, movement ->
simulate.
"""

from __future__ import annotations
