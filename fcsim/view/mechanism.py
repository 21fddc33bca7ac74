"""The picture of a collapse mechanism: blocks as they were and as they begin to move, hinges and sliding joints marked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.masonry.limit_analysis.analysis import LimitAnalysis
from fcsim.view.blocks import canvas, picture, solid
from fcsim.view.scene import COLOUR_MAP, DARKEST, offscreen
from fcsim.view.style import BLUE, GREY, ORANGE, RED, figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 0.08
"""The block that moves fastest is drawn as moved by this share of the structure's extent."""
MARKS = {"hinge": (RED, "o", "turns"), "sliding": (ORANGE, "s", "slides"), "open": (GREY, "x", "opens")}


def draw_mechanism(analysis: LimitAnalysis, path: Path) -> Path:
    """Draw the mechanism of a limit analysis into a .png (2D: also .svg) file; MissingDependency without matplotlib or pyvista."""
    if analysis.problem.dimension == 3:
        return _draw_solids(analysis, path)
    with styled():
        free = [corners for corners, block in zip(_corners(analysis), analysis.problem.blocks, strict=True) if not block.support]
        points = np.concatenate(free)
        width, height = np.ptp(points, axis=0)
        margin = SHOWN * max(width, height)
        shown = height + 2 * margin, width + 3 * margin
        drawing = figure(9.0, float(np.clip(9.0 * shown[0] / shown[1], 3.0, 12.0)) + 1.0, layout="constrained")
        axes = drawing.add_subplot()
        _draw_plane(axes, analysis)
        axes.set_xlim(points[:, 0].min() - 1.5 * margin, points[:, 0].max() + 1.5 * margin)
        axes.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("z [m]")
        drawing.legend(loc="outside lower left", ncols=5)
        return save(drawing, path)


def _corners(analysis: LimitAnalysis) -> list[FloatArray]:
    """The corners of each block, in order around it in 2D."""
    return [body.points for body in analysis.limit.model.rigid]


def _moved(analysis: LimitAnalysis) -> list[FloatArray]:
    """The corners of each block as the mechanism moves them, by rotations: the fastest by `SHOWN` of the extent."""
    model = analysis.limit.model
    v = analysis.lowest.v
    reach = float(np.linalg.norm(model.node_velocity(v), axis=1).max(initial=0.0))
    amount = SHOWN * analysis.problem.size / reach if reach > 0 else 0.0
    return np.split(model.positions(model.advance(np.zeros(model.n_dofs), amount * v)), model.node_offset[1:-1])


def _draw_plane(axes: Axes, analysis: LimitAnalysis) -> None:
    for corners, moved, block in zip(_corners(analysis), _moved(analysis), analysis.problem.blocks, strict=True):
        held = block.support
        if not held:
            axes.fill(*corners.T, facecolor="none", edgecolor="#c8c8c8", linewidth=0.7, linestyle="--", zorder=1)
        axes.fill(*moved.T, facecolor="#8c8c8c" if held else "#e8dcc8", edgecolor="#4d4d4d", linewidth=0.8, alpha=0.9, zorder=2)
    said = set()
    carried = [joint for joint in analysis.joints if joint.point is not None]
    most = max((joint.normal_force for joint in carried), default=0.0)
    for joint in carried:
        if joint.normal_force > 0.02 * most and joint.point is not None:
            axes.plot(*joint.point, ".", color=BLUE, markersize=2 + 7 * joint.normal_force / most, alpha=0.6, zorder=3)
    for joint in analysis.joints:
        if joint.state in MARKS:
            colour, mark, word = MARKS[joint.state]
            place = joint.point if joint.point is not None else joint.middle
            axes.plot(*place, mark, color=colour, markersize=7, zorder=4, label=None if word in said else f"joint {word}")
            said.add(word)
    axes.plot([], [], ".", color=BLUE, label="resultant of a joint")
    for one, other in _thrust_line(analysis):
        axes.plot(*zip(one, other, strict=True), "-", color=BLUE, linewidth=1.2, alpha=0.8, zorder=3)
    axes.set_title(f"{analysis.problem.title or analysis.problem.name}: {_said(analysis)}", wrap=True, fontsize=10)
    axes.grid(False)


def _thrust_line(analysis: LimitAnalysis) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Lines between the resultants of the two joints of every block that has two under pressure, as the voussoirs of an arch do."""
    places: dict[str, list[tuple[float, ...]]] = {}
    for joint in analysis.joints:
        for name in joint.between:
            if joint.point is not None:
                places.setdefault(name, []).append(joint.point)
    free = {block.name for block in analysis.problem.blocks if not block.support}
    return [(found[0], found[1]) for name, found in places.items() if name in free and len(found) == 2]


def _said(analysis: LimitAnalysis) -> str:
    found = analysis.lowest
    if found.outcome == "falls":
        return "falls under the loads that stay"
    if found.outcome == "unbounded":
        return "stands"
    return f"multiplier {found.multiplier:.4g}"


def _draw_solids(analysis: LimitAnalysis, path: Path) -> Path:
    pv = offscreen()
    model = analysis.limit.model
    speed = np.linalg.norm(model.node_velocity(analysis.lowest.v), axis=1)
    most = max(float(speed.max(initial=0.0)), 1e-300)
    plotter = canvas(pv)
    limits = []
    for number, (corners, body) in enumerate(zip(_moved(analysis), model.rigid, strict=True)):
        mesh, lines = solid(pv, corners, body.surfaces["skin"])
        if analysis.problem.blocks[number].support:
            plotter.add_mesh(mesh, color="#9a9a9a", opacity=0.6)
            continue
        limits.append(corners)
        mesh["speed"] = speed[model.node_offset[number] : model.node_offset[number + 1]] / most
        plotter.add_mesh(mesh, scalars="speed", cmap=COLOUR_MAP, clim=(0.0, 1.0 / DARKEST), show_scalar_bar=False)
        plotter.add_mesh(lines, color="#303030", line_width=1.5)
    for joint in analysis.joints:
        if joint.state in ("hinge", "sliding"):
            place = joint.point if joint.point is not None else joint.middle
            colour = MARKS[joint.state][0]
            plotter.add_mesh(pv.PolyData(np.array([place])), color=colour, point_size=9, render_points_as_spheres=True)
    text = f"{analysis.problem.title or analysis.problem.name}\n{_said(analysis)}; colour: speed"
    return picture(plotter, np.concatenate(limits), text, path)
