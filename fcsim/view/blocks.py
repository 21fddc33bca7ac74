"""The picture of a masonry model: its blocks, those that are held in grey."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.masonry.problem import MasonryProblem
from fcsim.view.scene import offscreen
from fcsim.view.style import figure, refuse_picture, save

if TYPE_CHECKING:
    from types import ModuleType

    from pyvista import Plotter, PolyData

HELD, FREE = "#9a9a9a", "#e8dcc8"


def draw_blocks(problem: MasonryProblem, path: Path) -> Path:
    """Draw the blocks into a picture (`KINDS`): a wall from its front, others from above.

    InputError for a path of another suffix, MissingDependency without pyvista.
    """
    refuse_picture(path)
    pv = offscreen()
    plotter = canvas(pv)
    free = []
    for block in problem.blocks:
        mesh, lines = solid(pv, block.surface.points, block.surface.triangles)
        plotter.add_mesh(mesh, color=HELD if block.support else FREE, opacity=0.5 if block.support else 1.0)
        plotter.add_mesh(lines, color="#303030", line_width=1.5)
        free += [] if block.support else [block.surface.points]
    text = f"{problem.title or problem.name}\n{len(free)} blocks, {len(problem.blocks) - len(free)} held"
    return picture(plotter, np.concatenate(free), text, path, (0.0, -1.0, 0.0) if problem.dimension == 2 else (0.9, -1.5, 0.7))


FILLED = 0.85
"""Share of a picture that blocks take at most, along the side that they fill: the text is above them."""


def canvas(pv: ModuleType) -> Plotter:
    """An empty picture."""
    plotter = pv.Plotter(off_screen=True, window_size=(1400, 1050))
    plotter.enable_anti_aliasing("ssaa")
    return plotter


def solid(pv: ModuleType, points: FloatArray, triangles: IntArray) -> tuple[PolyData, PolyData]:
    """A block's surface and its edges."""
    mesh = pv.PolyData(points, np.column_stack([np.full(len(triangles), 3), triangles]).ravel())
    return mesh, mesh.extract_feature_edges(1.0, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)


def picture(plotter: Plotter, points: FloatArray, text: str, path: Path, eye: tuple[float, float, float] = (0.9, -1.5, 0.7)) -> Path:
    """Look at all points (n, 3) from the direction `eye`, write the text above and the picture into a file."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    toward = np.array(eye) / np.linalg.norm(eye)
    right = np.cross([0.0, 0.0, 1.0], toward) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], toward))
    half_width, half_height = (float(np.abs((points - centre) @ axis).max()) for axis in (right, np.cross(toward, right)))
    plotter.camera_position = [tuple(centre + size * np.array(eye)), tuple(centre), (0.0, 0.0, 1.0)]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = max(half_height, half_width * plotter.window_size[1] / plotter.window_size[0]) / FILLED
    plotter.add_text(text, font_size=11, color="#303030")
    plotter.background_color = "white"
    image = plotter.screenshot(return_img=True)
    plotter.close()
    drawing = figure(image.shape[1] / 100, image.shape[0] / 100)
    drawing.figimage(image)
    return save(drawing, path)
