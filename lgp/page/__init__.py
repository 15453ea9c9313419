"""The page for the worker: a plan as a presentation with a sentence and an animation of each action.

plan -> sentences, scene animation (meshes, frames, shots) -> packed data, pictures -> folder with index.html
"""

from __future__ import annotations

from lgp.page.page import write_page

__all__ = ["write_page"]
