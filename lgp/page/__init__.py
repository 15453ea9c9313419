"""The page for the worker: a plan as a presentation that says, shows and plays each action.

plan -> sentences, view (meshes, frames, shots) -> data, pictures -> folder with index.html
"""

from __future__ import annotations

from lgp.page.page import write_page

__all__ = ["write_page"]
