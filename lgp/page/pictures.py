"""Pictures for browsers without WebGL: a still of the end of each action, and its motion as a short film (WebP)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgp.page.camera import ANGLE, Shot, framed
from lgp.page.mesh import Mesh, colour
from lgp.page.view import SceneAnimation, skinned

if TYPE_CHECKING:
    import pyvista
    from PIL import Image

STILL = (960, 720)
FILM = (560, 420)
"""[pixels]"""
FRAMES_PER_SECOND = 6.0
FINER = 1.5
"""Factor of supersampling, for smooth edges."""
QUALITY = 82
LIGHTS = (((-0.8, 0.9, 0.8), 0.62), ((1.0, 0.5, 0.6), 0.32), ((0.0, -0.6, 0.8), 0.12))
"""Positions relative to the eye (right, up, towards the eye) and intensities."""
AMBIENT = 0.34
GROUND = "#eef1f4"
FLOOR = "#dfe4e8"


def write_pictures(view: SceneAnimation, folder: Path) -> None:
    """Write `start.webp`, and for each action `action-1.webp` and the film `action-1-film.webp`."""
    import pyvista

    folder.mkdir(parents=True, exist_ok=True)
    # VTK warns about the missing display, which it does not need.
    with pyvista.vtk_verbosity("error"):
        _write(view, folder)


def _write(view: SceneAnimation, folder: Path) -> None:
    stage = _Stage(view)
    try:
        _save(folder / "start.webp", [stage.picture(0, view.shots[0], STILL)])
        first = 0
        for number, last in enumerate(view.ends.tolist(), 1):
            _save(folder / f"action-{number}.webp", [stage.picture(last, view.shots[number], STILL)])
            seconds = float(view.time[last] - view.time[first])
            count = max(2, round(seconds * FRAMES_PER_SECOND))
            moments = np.unique(np.round(np.linspace(first, last, count)).astype(int))
            film = [stage.picture(int(moment), view.shots[number], FILM) for moment in moments]
            _save(folder / f"action-{number}-film.webp", film, 1000.0 * seconds / len(film))
            first = last
    finally:
        stage.plotter.close()


def _save(path: Path, images: list[Image.Image], milliseconds: float = 0.0) -> None:
    more: dict[str, Any] = {}
    if len(images) > 1:
        more = {"save_all": True, "append_images": images[1:], "duration": round(milliseconds), "loop": 1}
    images[0].save(path, quality=QUALITY, method=4, **more)


class _Stage:
    """A scene that is rendered off screen, one moment after another."""

    def __init__(self, view: SceneAnimation) -> None:
        import pyvista

        self.view = view
        self.plotter = pyvista.Plotter(off_screen=True, window_size=list(STILL), lighting="none")
        self.plotter.renderer.SetBackground(*(colour(GROUND) / 255.0))
        self.plotter.disable_anti_aliasing()
        self._lights(pyvista)
        ground = view.shots[0].points[:, :2]
        middle = (ground.max(axis=0) + ground.min(axis=0)) / 2.0
        outer = 0.8 * float(np.ptp(ground, axis=0).max())
        floor = pyvista.Disc(center=(*middle, -0.002), inner=0.0, outer=outer, c_res=96)
        self.plotter.add_mesh(floor, color=FLOOR, lighting=False)
        self.actors = [self._add(view.meshes[body.mesh])[1] for body in view.bodies]
        self.skins = [self._add(skin.mesh)[0] for skin, _ in view.skins]

    def picture(self, moment: int, shot: Shot, size: tuple[int, int]) -> Image.Image:
        """Return the picture of a moment in a shot."""
        from PIL import Image

        for body, actor in zip(self.view.bodies, self.actors, strict=True):
            place = body.place if body.frame is None else self.view.place[moment, body.frame] @ body.place
            actor.user_matrix = place
        for (skin, frames), drawn_skin in zip(self.view.skins, self.skins, strict=True):
            drawn_skin.points = skinned(skin, self.view.place[moment, frames])
            drawn_skin.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)
        self.plotter.window_size = [round(FINER * side) for side in size]
        camera = framed(shot.points, shot.towards, size[0] / size[1])
        self.plotter.camera.position, self.plotter.camera.focal_point = camera.eye, camera.target
        self.plotter.camera.up, self.plotter.camera.view_angle = (0.0, 0.0, 1.0), ANGLE
        self.plotter.reset_camera_clipping_range()
        drawn = Image.fromarray(np.ascontiguousarray(self.plotter.screenshot(return_img=True)))
        return drawn.resize(size, Image.Resampling.LANCZOS)

    def _add(self, mesh: Mesh) -> tuple[pyvista.PolyData, pyvista.Actor]:
        import pyvista

        body = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces.astype(int))
        body["colour"] = mesh.colours
        body.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)
        actor = self.plotter.add_mesh(
            body,
            scalars="colour",
            rgb=True,
            smooth_shading=True,
            ambient=AMBIENT,
            diffuse=0.85,
            specular=0.5 * mesh.gloss,
            specular_power=20,
        )
        return body, actor

    def _lights(self, pyvista: Any) -> None:
        for place, strength in LIGHTS:
            self.plotter.add_light(pyvista.Light(position=place, intensity=strength, light_type="camera light"))
