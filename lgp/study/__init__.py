"""Studies with people: recordings of participants in several conditions -> scores, paired statistics and a page.

labels, manifest -> sources -> scoring -> analysis (assumptions) -> verdict, missing -> study -> page, figures.
Simulated studies: retarget, movement -> simulate.
"""

from __future__ import annotations
